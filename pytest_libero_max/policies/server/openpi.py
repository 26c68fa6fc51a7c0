"""The server's end of openpi's protocol: the metadata, then one answer for each map.

A request is the profile ``served``: the observation as the world delivers it, the query and the episode, so
that an answer is that of the adapter in process. An error is sent as text, and closes the
connection.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from pytest_libero_max.errors import LiberoMaxError, ServerError
from pytest_libero_max.events.schedules import Cadence
from pytest_libero_max.policies.clients.codecs import OPENPI, pack, unpack
from pytest_libero_max.policies.clients.transport import LOG
from pytest_libero_max.policies.contract import BatchItem, Episode, Query
from pytest_libero_max.policies.server.host import Host, InferenceRequest, Place

if TYPE_CHECKING:
    from websockets.sync.server import ServerConnection

CLOSE_AFTER_ERROR = 1011


class _Query(msgspec.Struct):
    index: int
    step: int
    seed: int


class _Episode(msgspec.Struct):
    suite: str
    task_index: int
    instruction: str
    seed: int
    max_steps: int


class _Frame(msgspec.Struct):
    observation: dict[str, np.ndarray[Any, Any]]
    step: int


class _Request(msgspec.Struct):
    """A request; further fields are ignored."""

    prompt: str
    observation: dict[str, np.ndarray[Any, Any]]
    query: _Query
    episode: _Episode
    cadence: tuple[int, int] | None = None
    """H and Q that the client plays; None where it does not say."""
    frames: tuple[_Frame, ...] = ()
    """Steps that a policy that sees every step has to be shown first."""
    memory: Any = None
    """See :class:`.memories.Place`."""


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
    """Return the reply to a request."""
    message = _read(request)
    query = Query(message.query.index, message.query.step, message.prompt, message.query.seed)
    item = BatchItem(message.observation, query, Episode(**msgspec.structs.asdict(message.episode)))
    place = Place.read(message.memory) if host.remembers else None
    cadence = None if message.cadence is None else Cadence(message.cadence[1], message.cadence[0])
    frames = tuple((frame.observation, frame.step) for frame in message.frames)
    result = host.ask(InferenceRequest(item, place, cadence, frames))
    reply = {"actions": result.actions, "batch": result.batch}
    return reply if result.memory is None else {**reply, "memory": result.memory}


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


def _read(request: Any) -> _Request:
    """Return what a client asks."""
    try:
        return msgspec.convert(request, _Request)
    except (msgspec.ValidationError, AttributeError) as error:  # an array in the place of a map has no keys
        raise ServerError(f"a request that is not that of the profile 'served' ({error})") from error
