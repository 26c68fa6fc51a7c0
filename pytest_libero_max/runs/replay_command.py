"""The command that plays a case of a run again, just as the run did.

It is printed for people. What this package plays again itself takes every place from this machine
(:class:`Places`).
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.runs.plan import OBJECT, OUTSIDE
from pytest_libero_max.runs.protocol import depends_on_selection, option_values
from pytest_libero_max.substrates.registry import described_substrate

if TYPE_CHECKING:
    from pytest_libero_max.runs.outcomes import RunOutcomes
    from pytest_libero_max.runs.store import StoredRun

OUTPUT = "libero-max-replay"
"""Output folder of the replayed pair, so that the run itself is not set aside."""

_IN_ITS_PROGRAM = "in the program of that run, in another folder: no command here can load its policy."


@dataclass(frozen=True)
class Places:
    """What is looked for outside the folder of a run to play its pairs again."""

    policy: str
    profile: str | None = None
    manifest: str | None = None
    program: str | None = None
    """Name or file of the program that is laid over the cases, if any."""
    study: str | None = None
    """Value of its option, if a file spells it or policies of it have places."""
    installations: tuple[str, ...] = ()
    """LIBERO's folders; none: what ``import libero`` finds."""
    assets: str | None = None
    """Models and textures for them."""
    arguments: tuple[str, ...] = ()
    """Further arguments of pytest, for example ``-p PLUGIN``."""

    @classmethod
    def named_by(cls, provenance: Json) -> Places:
        """Return the places that a run names: for people, who read a command before they give it."""
        policy, cases, substrate = (provenance[name] for name in ("policy", "case_set", "substrate"))
        return cls(
            policy["reference"],
            policy.get("profile"),
            cases.get("path"),
            cases.get("program"),
            cases.get("study"),
            tuple(substrate.get("roots", ())),
            substrate.get("assets"),
        )


def replay_command(run: StoredRun | RunOutcomes, places: Places | None = None) -> list[str]:
    """Return the command that plays one case of a run again, once the case's item id is appended.

    It gives the same record in the folder in which the run was started, on a machine with the same files.
    It is empty for the run of a program that alone has its policy.

    Args:
        places: Places on this machine. None: those that the run names, and then nothing but people may
            execute the command.
    """
    return replay_of(run.run.provenance, places)


def replay_of(provenance: Json, places: Places | None = None) -> list[str]:
    """Return :func:`replay_command` of a run with this provenance."""
    if is_outside(provenance):
        return []
    places = places or Places.named_by(provenance)
    kind, _, name = provenance["case_set"]["name"].partition(" ")
    options: list[tuple[str, object]] = [("policy", places.policy), ("profile", places.profile)]
    if kind in ("track", "manifest") and name:
        options.append((kind, places.manifest or name))
    options.append(("program", places.program))
    options.append(("substrate", described_substrate(provenance["substrate"])))
    options += [("libero", root) for root in places.installations]
    options.append(("libero-assets", places.assets))
    options += option_values(provenance)
    study = provenance["protocol"].get("study") or {}
    name = ":".join(filter(None, [study.get("name"), study.get("settings")])) or None
    options.append(("study", places.study or (f"{name}.json" if "document" in study else name)))
    options += _selection(provenance) if depends_on_selection(provenance) else []
    options.append(("output", OUTPUT))
    given = (
        f"--libero-max-{name}" if value is True else f"--libero-max-{name}={value}"
        for name, value in options
        if value is not None
    )
    return ["pytest", *places.arguments, *given, "-k"]


def replay_text(replay: Sequence[str], item_id: str = "") -> str:
    """Return how to play a case again, in a line."""
    return shlex.join([*replay, *filter(None, [item_id])]) if replay else _IN_ITS_PROGRAM


def film_text(replay: Sequence[str], item_id: str = "") -> str:
    """Return how to play a case again and film it, in a line; arguments as for :func:`replay_text`."""
    return replay_text([*replay[:-1], "--libero-max-film=all", *replay[-1:]] if replay else [], item_id)


def traces_setting(provenance: Json) -> str:
    """Return the setting that lets such a run keep the traces of all pairs."""
    code = provenance["policy"].get("code")
    calls = {OUTSIDE: 'PairedRun(..., traces="all")', OBJECT: 'evaluate(..., traces="all")'}
    return calls.get(code, "--libero-max-traces=all")


def is_outside(provenance: Json) -> bool:
    """Return True if only the program of the run has its policy, for example another evaluation loop."""
    return provenance["policy"].get("code") in (OUTSIDE, OBJECT)


def _selection(provenance: Json) -> list[tuple[str, object]]:
    """Return options that select the same pairs as the run did, before ``-k``."""
    selection = provenance.get("selection") or {}
    words = dict(
        text.removeprefix("--libero-max-").partition("=")[::2] for text in selection.get("asked", ())
    )
    shards = selection.get("shards")
    shard = f"{shards['present'][0]}/{shards['of']}" if shards and len(shards["present"]) == 1 else None
    return [
        ("suites", words.get("suites")),
        ("only-installed", True if "only-installed" in words else None),
        ("limit", provenance["case_set"].get("limit")),
        ("shard", shard),
    ]
