"""Rules for unusual requests: large and small images, and requests that lack their inputs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.conformance.policy.subject import QUERIES
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule, unexamined
from pytest_libero_max.conformance.server.clients import AT_ONCE, STRANGER, asked_together
from pytest_libero_max.conformance.server.subject import (
    ServerSubject,
    alter_requests,
    is_in_words,
    served,
    still_answers,
)
from pytest_libero_max.errors import AdapterError, LiberoMaxError, ServerError, counted

LARGE_PX, SMALL_PX = 1024, 16

Array = NDArray[Any]


@rule("server/requests/large", "should", needs=STRANGER)
def large_images(subject: ServerSubject) -> Finding:
    """Answer a request with images of 1024 pixels, or refuse it in words."""
    return _with_images(
        subject,
        LARGE_PX,
        "Permit larger messages (websockets: max_size=None), in the server and in a proxy before it.",
    )


@rule("server/requests/small", "should", needs=STRANGER)
def small_images(subject: ServerSubject) -> Finding:
    """Answer a request with images of 16 pixels, or refuse it in words."""
    return _with_images(
        subject, SMALL_PX, "Resize images before they reach the model, or refuse other sizes in words."
    )


def _with_images(subject: ServerSubject, side: int, cure: str) -> Finding:
    """Return the finding of a request whose images have another size."""
    sizes: list[int] = []
    with subject.client() as client:
        alter_requests(client, partial(_resized, side=side, sizes=sizes))
        observation = {key: resized(value, side) for key, value in client.shown.copy(0).items()}
        try:
            try:
                client.ask(0)
                if not sizes:  # they are sent as files, which are made from the observation
                    client.ask(0, observation=observation)
            except AdapterError:
                return unexamined("the profile makes images of one size only")
            outcome = "is answered"
        except ServerError as error:
            outcome = str(error).rstrip(".")
            if not is_in_words(outcome):
                return broken(f"images of {side} pixels: {outcome}", "an answer, or an error in words", cure)
            outcome = "is refused in words"
    size = f" ({sum(sizes) / 1e6:.1f} MB)" if sizes else ""
    return kept(f"a request with images of {side} pixels{size} {outcome}")


def resized(array: Array, side: int) -> Array:
    """Return an image with about so many pixels a side, by repeating or leaving out; other arrays as is."""
    if array.ndim < 3 or array.shape[-1] != 3 or min(array.shape[-3:-1]) < 2:
        return array
    for axis in (-3, -2):
        count = array.shape[axis]
        array = np.take(array, np.arange(side) * count // side, axis=axis)
    return array


def _resized(request: Any, side: int, sizes: list[int]) -> Any:
    if isinstance(request, Mapping):
        return {key: _resized(value, side, sizes) for key, value in request.items()}
    if isinstance(request, list | tuple):
        return [_resized(value, side, sizes) for value in request]
    if isinstance(request, np.ndarray) and (array := resized(request, side)) is not request:
        sizes.append(array.nbytes)
        return array
    return request


@rule("server/errors/words", "should", needs=STRANGER)
def errors_in_words(subject: ServerSubject) -> Finding:
    """Answer a request that lacks its inputs with an error in words."""
    error = _error_of_nonsense(subject)
    if error is None:
        return broken(
            "a request without any input was answered with actions",
            "an error",
            "The model is not asked, or missing inputs are replaced by zeros.",
        )
    if is_in_words(error):
        return kept("a request without any input is answered with an error in words")
    return broken(
        f"a request without any input: {error}",
        "an error in words",
        "Catch exceptions of the policy, and send their text: users otherwise see a lost connection.",
    )


@rule("server/errors/survives", "must", needs=STRANGER)
def survives_errors(subject: ServerSubject) -> Finding:
    """Go on after a request that lacks its inputs."""
    _error_of_nonsense(subject)
    return still_answers(subject, "a request without any input")


@rule("server/errors/neighbours", "should", needs=AT_ONCE)
def spares_neighbours(subject: ServerSubject) -> Finding:
    """Answer clients that ask at the same moment as one whose request lacks its inputs."""
    try:
        subject.alone(0)
    except ServerError:
        return unexamined("the server does not answer any more")
    with ExitStack() as stack:
        clients = [stack.enter_context(subject.client()) for _ in range(QUERIES)]
        alter_requests(clients[0], _nonsense(subject))
        answers = asked_together(clients)[1:]
        asked_again = [served(client).client.interruptions > 0 for client in clients[1:]]
    met = sum(
        again or isinstance(answer, LiberoMaxError)
        for again, answer in zip(asked_again, answers, strict=True)
    )
    if not met:
        return kept(f"{counted(len(answers), 'client')} beside one without inputs are answered")
    return broken(
        f"{met} of {counted(len(answers), 'client')} that asked beside one without inputs met an error",
        "an error for that client alone",
        "A batch fails as a whole: check requests before they are batched, or compute them again alone.",
    )


def _error_of_nonsense(subject: ServerSubject) -> str | None:
    """Return the error that a request without inputs ends with; None where it is answered."""
    with subject.client() as client:
        alter_requests(client, _nonsense(subject))
        try:
            client.ask(0)
        except ServerError as error:
            return str(error)
    return None


def _nonsense(subject: ServerSubject) -> Callable[[Any], Any]:
    """Return a function that takes the inputs out of a request."""
    fixed = set(_literals(subject.profile.tables.get("request", {})))

    def keeps(value: Any) -> bool:
        return not isinstance(value, np.ndarray | bytes | str) or (isinstance(value, str) and value in fixed)

    return partial(_without, keeps=keeps)


def _without(value: Any, keeps: Callable[[Any], bool]) -> Any:
    if isinstance(value, Mapping):
        return {key: _without(item, keeps) for key, item in value.items() if keeps(item)}
    if isinstance(value, list | tuple):
        return [_without(item, keeps) for item in value if keeps(item)]
    return value


def _literals(layout: Any) -> Iterator[str]:
    """Yield the texts of a profile's request that are no inputs, for example the type of a message."""
    if isinstance(layout, Mapping | list):
        for value in layout.values() if isinstance(layout, Mapping) else layout:
            yield from _literals(value)
    elif isinstance(layout, str) and layout[:1] != "$":
        yield layout
