"""The protocol of vla-eval's model servers: WebSocket, numbered msgpack messages, chunks kept by the server.

The server answers one action for each observation and keeps the rest of the chunk, or, where it has no
``chunk_size``, returns the chunk. So that a query gets its Q actions either way, it begins an episode, which
empties the buffer, and shows the same observation until it has them. A server that remembers more than its
buffer between the steps of an episode cannot be asked like this.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from pytest_libero_max.errors import AdapterError, ServerError
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.policies.clients.codecs import VLA_EVAL, Dialect, pack, shortened, unpack
from pytest_libero_max.policies.clients.protocol import Opening, ServerProtocol
from pytest_libero_max.policies.clients.served import Adapt, ServedPolicy
from pytest_libero_max.policies.clients.transport import reported
from pytest_libero_max.policies.clients.websocket import Socket
from pytest_libero_max.policies.contract import PolicySpec, Query
from pytest_libero_max.worlds.contract import Observation

PROTOCOL_VERSION = 1


class VlaEvalLink(Socket):
    """A connection to a model server of vla-eval."""

    dialect: ClassVar[Dialect] = VLA_EVAL
    message: bytes | str = b""

    _seq = 0

    def open(self) -> Any:
        """Connect and return the server's greeting."""
        super().open()
        greeting = {"harness_version": "pytest-libero-max", "protocol_version": PROTOCOL_VERSION}
        seq = self._send("hello", {**greeting, "benchmark": "libero-max"})
        payload = self._read("hello", seq, "the answer to hello in vla-eval's protocol")
        version = payload.get("protocol_version")
        if not isinstance(version, int) or version != PROTOCOL_VERSION:
            raise ServerError(
                f"the server speaks version {version!r} of the protocol, but this side speaks version "
                f"{PROTOCOL_VERSION}"
            )
        return payload

    def ask(self, request: Any) -> Any:
        """Send ``{"task": ..., "observation": ..., "count": Q}``; return ``{"actions": (n, 7)}``, n >= Q."""
        self._send("episode_start", {"task": request["task"]})
        rows: list[Any] = []
        while len(rows) < request["count"]:
            seq = self._send("observation", request["observation"])
            actions = self._read("action", seq).get("actions")
            if not isinstance(actions, np.ndarray) or actions.ndim not in (1, 2):
                seen = getattr(actions, "shape", type(actions).__name__)
                raise ServerError(
                    f"the reply's 'actions' are {seen}, but must be an array of one or two axes"
                )
            if actions.ndim == 2:
                if rows:
                    raise ServerError("the server returned single actions first, and then a chunk")
                return {"actions": actions}
            if rows and actions.shape != rows[0].shape:
                raise ServerError(f"actions of shapes {rows[0].shape} and {actions.shape} in one chunk")
            rows.append(actions)
        return {"actions": np.stack(rows), "singly": True}

    def _send(self, kind: str, payload: dict[str, Any]) -> int:
        self._seq += 1
        message = {"type": kind, "payload": payload, "seq": self._seq, "timestamp": time.time()}
        self.send(pack(message, VLA_EVAL))
        return self._seq

    def _read(self, kind: str, seq: int, awaited: str = "") -> dict[Any, Any]:
        self.message = self.receive(awaited)
        message = unpack(self.message, VLA_EVAL)
        if not isinstance(message, dict) or not isinstance(message.get("payload"), dict):
            raise ServerError("a message is no map with a map as 'payload'")
        payload: dict[Any, Any] = message["payload"]
        message_type, number = str(message.get("type")), message.get("seq")
        if message_type == "error":
            raise reported(payload.get("error"))
        if message_type != kind or not isinstance(number, int) or number != seq:
            raise ServerError(
                f"a message of type {shortened(message_type)} with seq {shortened(str(number))} came, "
                f"but {kind!r} with seq {seq} was expected"
            )
        return payload


class OneByOnePolicy(ServedPolicy):
    """A policy behind a server that may hand out the actions of a chunk one by one."""

    def request(self, observation: Observation, query: Query) -> dict[str, Any]:
        return {**super().request(observation, query), "count": self.spec.query_interval}

    def read(self, reply: Any) -> Actions:
        actions = super().read(reply)
        # The length of a chunk that came one by one stays unknown.
        self.returned = None if reply.get("singly") else self.returned
        return actions


class VlaEvalProtocol(ServerProtocol):
    """The protocol of vla-eval's model servers, which declare the inputs they want."""

    scheme = "vla-eval"
    port = 8000
    secure_port = 443
    recognised = True

    def link(self, opening: Opening) -> VlaEvalLink:
        return VlaEvalLink(opening.address)

    def adapt(self, opening: Opening) -> Adapt:
        def adapt(greeting: Any, spec: PolicySpec) -> tuple[Any, PolicySpec]:
            layout = wanted(opening.profile.tables.get("request", {}), greeting)
            spec = replace(spec, cameras=opening.request.cameras_of(layout))
            return layout, replace(spec, control="absolute") if returns_poses(greeting) else spec

        return adapt

    def policy(self, greeting: Mapping[str, Any]) -> type[ServedPolicy]:
        return OneByOnePolicy


def wanted(layout: Mapping[str, Any], greeting: Any) -> dict[str, Any]:
    """Return the request as the server's greeting asks for it.

    The wrist image and the state are left out where they are not asked for; the state keeps the sign of the
    quaternion where the server says ``quat_no_antipodal``.
    """
    parameters, formats = _declared(greeting)
    if _flags(greeting, "capabilities").get("memory"):
        raise AdapterError(
            "The policy behind this server has a memory, which would be emptied before every query of this "
            "protocol. Ask the server of `libero-max serve` with openpi:// and --libero-max-profile=served."
        )
    gripper = _format(formats, "gripper")
    if gripper not in (None, "raw", "binary_close_positive"):
        raise AdapterError(
            f"The server's gripper has the format {gripper!r}, but LIBERO's is 'binary_close_positive': +1 "
            "closes. Start the server so that it converts it, as vla-eval's own configuration for LIBERO "
            "does."
        )
    if not isinstance(layout.get("observation"), dict) or not isinstance(
        layout["observation"].get("images", {}), dict
    ):
        raise AdapterError("The profile's request lacks an 'observation' whose 'images' are a table.")
    observation = dict(layout["observation"])
    if not parameters.get("send_wrist_image"):
        images = observation.get("images", {})
        observation["images"] = {key: image for key, image in images.items() if key != "wrist"}
    if not parameters.get("send_state"):
        observation = {key: value for key, value in observation.items() if key[-6:] != "states"}
    elif parameters.get("quat_no_antipodal"):
        observation["states"] = "$state_no_antipodal"
    return {**layout, "observation": observation}


def returns_poses(greeting: Any) -> bool:
    """Return True if the server's greeting says that its actions are poses in the world."""
    parameters, formats = _declared(greeting)
    return bool(parameters.get("absolute_action")) or _format(formats, "position") == "absolute_xyz"


def _declared(greeting: Any) -> tuple[dict[Any, Any], dict[Any, Any]]:
    """Return inputs that a server asks for, and its description of its actions."""
    return _flags(greeting, "observation_params"), _map(greeting, "action_spec")


def _flags(greeting: Any, name: str) -> dict[Any, Any]:
    flags = _map(greeting, name)
    if any(isinstance(value, np.ndarray) for value in flags.values()):
        raise ServerError(f"the greeting's {name!r} hold an array, but must be flags")
    return flags


def _map(greeting: Any, name: str) -> dict[Any, Any]:
    """Return a part of a greeting; empty where there is none."""
    part = greeting.get(name)
    if part is None:
        return {}
    if not isinstance(part, dict):
        raise ServerError(f"the greeting's {name!r} are a {type(part).__name__}, but must be a map")
    return part


def _format(formats: dict[Any, Any], name: str) -> str | None:
    """Return the format of one part of the actions; None where the server does not say."""
    part = formats.get(name)
    word = part.get("format") if isinstance(part, dict) else None
    if word is not None and not isinstance(word, str):
        raise ServerError(f"the format of {name!r} in the greeting is a {type(word).__name__}, not a word")
    return word
