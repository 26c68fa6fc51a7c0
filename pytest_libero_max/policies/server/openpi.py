"""The server's end of openpi's protocol: the metadata, then one answer for each map.

A request is the profile ``served``: the observation as the world delivers it, the query and the episode, so
that an answer is that of the adapter in process. An error is sent as text, and closes the
connection.
"""

from __future__ import annotations

import logging
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from pytest_libero_max.errors import LiberoMaxError, ServerError
from pytest_libero_max.events.schedules import Cadence
from pytest_libero_max.policies.clients.codecs import OPENPI, pack, unpack
from pytest_libero_max.policies.contract import BatchItem, Episode, Query
from pytest_libero_max.policies.server.host import Host, InferenceRequest
from pytest_libero_max.policies.server.memories import Place

if TYPE_CHECKING:
    from websockets.sync.server import ServerConnection

    from pytest_libero_max.worlds.contract import Observation

LOG = logging.getLogger("pytest_libero_max.servers")

CLOSE_AFTER_ERROR = 1011


def greeting(host: Host) -> dict[str, Any]:
    """Return the metadata that a client gets first."""
    batching = host.batching
    return {
        "libero_max": 1,
        "spec": host.spec.to_dict(),
        "memory": host.remembers,
        "cadence": True,
        "sees": host.sees,
        "batching": {"size": batching.size, "wait_s": batching.wait_s, "pad": batching.pad},
    }


def answer(host: Host, request: Any) -> dict[str, Any]:
    """Return the reply to a request.

    Raises:
        ServerError: The request is not that of the profile ``served``.
        LiberoMaxError: See :meth:`Host.ask`.
    """
    item = _item(request)
    place = Place.read(request.get("memory")) if host.remembers else None
    found = host.ask(InferenceRequest(item, place, _cadence(request), _frames(request)))
    reply = {"actions": found.actions, "batch": found.batch}
    return reply if found.memory is None else {**reply, "memory": found.memory}


def talk(connection: ServerConnection, host: Host) -> None:
    """Answer a client until it goes or errs."""
    from websockets.exceptions import ConnectionClosed

    with suppress(ConnectionClosed):
        connection.send(pack(greeting(host), OPENPI))
        for message in connection:
            try:
                reply = pack(answer(host, unpack(message, OPENPI)), OPENPI)
            except Exception as error:  # whatever a request brings about is the client's to know
                LOG.warning("%s", error, exc_info=not isinstance(error, LiberoMaxError))
                host.refused(error)
                connection.send(f"{type(error).__name__}: {error}".replace("\n", " "))
                connection.close(CLOSE_AFTER_ERROR)
                return
            connection.send(reply)


def _item(request: Any) -> BatchItem:
    try:
        observation, query, episode = (request[key] for key in ("observation", "query", "episode"))
        return BatchItem(
            _arrays(observation),
            Query(
                _integer(query, "index"),
                _integer(query, "step"),
                _text(request, "prompt"),
                _integer(query, "seed"),
            ),
            Episode(
                _text(episode, "suite"),
                _integer(episode, "task_index"),
                _text(episode, "instruction"),
                _integer(episode, "seed"),
                _integer(episode, "max_steps"),
            ),
        )
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise ServerError(
            f"a request that is not that of the profile 'served' ({type(error).__name__}: {error})"
        ) from error


def _cadence(request: Any) -> Cadence | None:
    """H and Q that the client plays; None where it does not say.

    Raises:
        ServerError: They are no two integers.
    """
    value = request.get("cadence")
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 2 or not all(type(number) is int for number in value):
        raise ServerError("a request whose 'cadence' is no list of H and Q")
    horizon, query_interval = value
    return Cadence(query_interval, horizon)


def _frames(request: Any) -> tuple[tuple[Observation, int], ...]:
    """Return steps that a policy that sees every step has to be shown first.

    Raises:
        ServerError: They are no list of maps with an observation and a step.
    """
    try:
        return tuple(
            (_arrays(frame["observation"]), _integer(frame, "step")) for frame in request.get("frames", [])
        )
    except (LookupError, TypeError, AttributeError) as error:
        raise ServerError(f"a request with frames that are none ({type(error).__name__}: {error})") from error


def _arrays(observation: Any) -> Observation:
    for key, value in observation.items():
        if not (isinstance(key, str) and isinstance(value, np.ndarray)):
            raise TypeError("an observation holds arrays by their names")
    return dict(observation)


def _integer(values: Any, key: str) -> int:
    value = values[key]
    if not isinstance(value, int) or isinstance(value, bool):
        raise TypeError(f"{key} is a {type(value).__name__}, but must be an integer")
    return value


def _text(values: Any, key: str) -> str:
    value = values[key]
    if not isinstance(value, str):
        raise TypeError(f"{key} is a {type(value).__name__}, but must be a text")
    return value
