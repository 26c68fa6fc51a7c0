"""Plays a pair in the process it is called in, with pytest's fixtures."""

from __future__ import annotations

import traceback
from typing import TYPE_CHECKING, NoReturn

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import AdapterError, LiberoMaxError, class_name, text_of
from pytest_libero_max.evaluation.player import (
    BROKEN_POLICY,
    FailedPair,
    PairPlayer,
    Unsupported,
)
from pytest_libero_max.evaluation.policy_source import PolicySource
from pytest_libero_max.evaluation.processes.pair_process import PairProcess
from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.pairing.record import POLICY_PHASE, PairRecord
from pytest_libero_max.plugin.collection import cases_of_run
from pytest_libero_max.plugin.processes.sending import encodable
from pytest_libero_max.plugin.processes.this_process import pair_process_of
from pytest_libero_max.plugin.run_stop import stop_run
from pytest_libero_max.plugin.stash_keys import LOADED, NOTE, RESULT

if TYPE_CHECKING:
    from pytest_libero_max.policies.contract import Policy
    from pytest_libero_max.substrates.contract import Substrate
    from pytest_libero_max.worlds.contract import World

LIMIT_REACHED = (
    "a pair reached a limit in the session's own process, which cannot be trusted any more. Play with -n 1 "
    "or --libero-max-isolate, so that the other pairs go on"
)

_PLAYER = pytest.StashKey[PairPlayer]()


class _Fixtures:
    """Policy and worlds of a pair from its fixtures, which are set up when they are asked for."""

    def __init__(self, request: pytest.FixtureRequest, settings: Settings) -> None:
        self._request, self._settings = request, settings

    def policy(self) -> Policy:
        config = self._request.config
        policy: Policy = self._request.getfixturevalue("libero_max_policy")
        if policy is not config.stash.get(LOADED, None):
            raise AdapterError(
                "the fixture libero_max_policy is overridden, so another policy than "
                f"{self._settings.reference!r} would be played under its name. Take the fixture "
                "away, and name the adapter that is to be played with --libero-max-policy."
            )
        return policy

    def substrate(self) -> Substrate:
        substrate: Substrate = self._request.getfixturevalue("libero_max_substrate")
        return substrate

    def world(self, case: Case) -> World:
        world: World = self._request.getfixturevalue("libero_max_world")
        return world


def play_here(request: pytest.FixtureRequest, case: Case, settings: Settings) -> PairRecord:
    """Play a pair in the process of the session or of its worker; an error is kept on the item."""
    process = pair_process_of(request.config, settings)
    try:
        with process.pair():
            return play(request, case, settings, process)
    except Unsupported as unsupported:
        pytest.skip(str(unsupported))
    except BaseException as error:
        raised = error
    return _leave(request, case, process, raised)


def play(request: pytest.FixtureRequest, case: Case, settings: Settings, process: PairProcess) -> PairRecord:
    """Play a pair in this process; raises what :meth:`.PairPlayer.play` does."""
    player = _player_of(request.config, settings)
    played = player.play(case, _Fixtures(request, settings), process)
    if played.note is not None:
        request.node.stash[NOTE] = played.note
    return played.record


def _player_of(config: pytest.Config, settings: Settings) -> PairPlayer:
    """Return the player of this process."""
    if _PLAYER not in config.stash:
        second_base = cases_of_run(config).with_second_base
        player = config.stash[_PLAYER] = PairPlayer(PolicySource(settings), second_base)
        config.add_cleanup(player.close)
    return config.stash[_PLAYER]


def _leave(
    request: pytest.FixtureRequest, case: Case, process: PairProcess, error: BaseException
) -> NoReturn:
    """Keep an error on the item and fail it; outside of the error's handler, or pytest shows it twice."""
    failed = FailedPair.of(case, process, error)
    request.node.stash[RESULT] = failed.error.to_dict()
    if failed.limit:
        stop_run(request.node, LIMIT_REACHED)
        pytest.fail(f"{failed.error.kind}: {failed.error.message}", pytrace=False)
    if process.phase == POLICY_PHASE:
        stop_run(request.node, BROKEN_POLICY)
    if isinstance(error, LiberoMaxError):
        pytest.fail(explain(error), pytrace=False)
    whole = "".join(traceback.format_exception(error))
    if encodable(whole) != whole:  # a reporter would read the exception itself, and write it as UTF-8
        pytest.fail(encodable(whole), pytrace=False)
    if not isinstance(error, Exception):
        # pytest keeps no fixture that ends like this, and every later item would fail for another reason.
        raise LiberoMaxError(f"{type(error).__name__} in phase {process.phase!r}: {error}") from error
    raise error


def explain(error: BaseException) -> str:
    """Return the message with the frames of the user's own code and none of this package, fit for UTF-8."""
    text = f"{class_name(error)}: {text_of(error)}"
    cause = error.__cause__
    if cause is not None and not isinstance(cause, LiberoMaxError):
        text += "\n\n" + "".join(traceback.format_exception(type(cause), cause, cause.__traceback__))
    return encodable(text)
