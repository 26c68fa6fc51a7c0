"""Servers on the loopback interface, in threads, that speak the protocols and keep what they were sent."""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.codecs import OPENPI, VLA_EVAL, Dialect, pack, unpack
from pytest_libero_max.policies.contract import Episode, Query
from pytest_libero_max.worlds.contract import ImageSize, height_and_width

QUIET = logging.getLogger("tests.fakes")
QUIET.addHandler(logging.NullHandler())
QUIET.propagate = False

Handler = Callable[[Any], Any]
"""From what a server was sent to what it answers: bytes as they are, text as text, None to hang up."""

EPISODE = Episode("libero_spatial", 3, "put the Box on the plate", 195, 220)


def query(index: int = 0) -> Query:
    return Query(index, 5 * index, "put the Box on the plate", 1234 + index)


def observation(size: ImageSize = 256) -> dict[str, NDArray[Any]]:
    """A red square in the first corner of the scene's image, a green one in the wrist's, and w < 0."""
    height, width = height_and_width(size)
    scene, wrist = np.zeros((2, height, width, 3), dtype=np.uint8)
    scene[: height // 8, : width // 8, 0] = 255
    wrist[: height // 8, : width // 8, 1] = 255
    return {
        "agentview_image": scene,
        "robot0_eye_in_hand_image": wrist,
        "robot0_eef_pos": np.array([0.1, 0.2, 0.9]),
        "robot0_eef_quat": np.array([0.8, 0.36, 0.48, -0.0]) * 0.8 + np.array([0.0, 0.0, 0.0, -0.6]),
        "robot0_gripper_qpos": np.array([0.04, -0.03]),
        "robot0_gripper_qvel": np.zeros(2),
        "robot0_joint_pos": np.zeros(7),
        "robot0_joint_vel": np.zeros(7),
    }


NO_REPLY = object()


@contextmanager
def websocket(handler: Handler, greeting: bytes | str | None = None, port: int = 0) -> Iterator[int]:
    """A WebSocket server; the port it listens on. It closes for None, and is silent for ``NO_REPLY``."""
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.server import ServerConnection, serve

    def talk(connection: ServerConnection) -> None:
        with suppress(ConnectionClosed, OSError):
            if greeting is not None:
                connection.send(greeting)
            for message in connection:
                answer = handler(message)
                if answer is None:
                    connection.close()
                    return
                if answer is not NO_REPLY:
                    connection.send(answer)

    with serve(talk, "127.0.0.1", port, compression=None, max_size=None, logger=QUIET) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield server.socket.getsockname()[1]
        finally:
            server.shutdown()
            thread.join(5)


@contextmanager
def openpi(handler: Handler, metadata: Any = None, port: int = 0) -> Iterator[int]:
    """A server of the openpi protocol; the handler gets and returns values."""

    def talk(message: Any) -> Any:
        answer = handler(unpack(message, OPENPI))
        return answer if isinstance(answer, bytes | str | None) else pack(answer, OPENPI)

    with websocket(talk, pack(metadata or {}, OPENPI), port) as found:
        yield found


@contextmanager
def vla_eval(
    handler: Handler, chunk: int | None = None, greeting: dict[str, Any] | None = None
) -> Iterator[int]:
    """A model server as vla-eval's: it buffers ``chunk`` actions, or returns whole chunks for None."""
    sessions: dict[str, list[Any]] = {"buffer": []}

    def talk(content: Any) -> Any:
        message = unpack(content, VLA_EVAL)
        kind, answer, payload = message["type"], "action", message["payload"]
        if kind == "hello":
            answer, payload = "hello", {"harness_version": "0.8.0", "protocol_version": 1, **(greeting or {})}
        elif kind == "episode_start":
            sessions["buffer"] = []
            handler({"episode_start": payload})
            return NO_REPLY
        elif not sessions["buffer"]:
            actions = handler(payload)
            if not isinstance(actions, np.ndarray):
                answer, payload = "error", {"error": str(actions)}
            elif chunk is None:
                payload = {"actions": actions}
            else:
                sessions["buffer"] = list(actions[:chunk])
        if answer == "action" and sessions["buffer"]:
            payload = {"actions": sessions["buffer"].pop(0)}
        return pack({"type": answer, "payload": payload, "seq": message["seq"], "timestamp": 0.0}, VLA_EVAL)

    with websocket(talk) as port:
        yield port


@contextmanager
def http(handler: Handler) -> Iterator[int]:
    """A server of JSON over HTTP; the handler gets (path, value) and returns a value, or (status, text)."""

    class Talk(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            answer = handler((self.path, json.loads(body)))
            status, text = answer if isinstance(answer, tuple) else (200, json.dumps(answer))
            self.send_response(status)
            self.send_header("Content-Length", str(len(text.encode())))
            self.end_headers()
            self.wfile.write(text.encode())

        def log_message(self, format: str, *args: Any) -> None:
            pass

    class Server(ThreadingHTTPServer):
        daemon_threads = True

    with Server(("127.0.0.1", 0), Talk) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
        thread.start()
        try:
            yield server.server_address[1]
        finally:
            server.shutdown()
            thread.join(5)


@contextmanager
def zeromq(handler: Handler, dialect: Dialect, port: int = 0) -> Iterator[int]:
    """A REP socket; the handler gets and returns values."""
    zmq: Any = import_module("zmq")
    context = zmq.Context()
    socket = context.socket(zmq.REP)
    socket.linger = 0
    if port:
        socket.bind(f"tcp://127.0.0.1:{port}")
    else:
        port = socket.bind_to_random_port("tcp://127.0.0.1")
    stop = threading.Event()

    def talk() -> None:
        while not stop.is_set():
            if socket.poll(20):
                try:
                    content = b"".join(socket.recv_multipart(zmq.NOBLOCK))
                except zmq.Again:  # bytes of another protocol, which the socket has dropped
                    continue
                try:
                    answer = handler(unpack(content, dialect))
                except ServerError as error:
                    answer = {"error": str(error)}
                socket.send(answer if isinstance(answer, bytes) else pack(answer, dialect))
        socket.close()

    thread = threading.Thread(target=talk, daemon=True)
    thread.start()
    try:
        yield port
    finally:
        stop.set()
        thread.join(5)
        context.term()
