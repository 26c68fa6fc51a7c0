"""Protocol class of a run: what the world does while the policy is asked, in one line of every report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Literal

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.latency import CHANGED_BY, Latency
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.pairing.record_rules import CONTROL_HZ
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.report_document import Inference

_NAMED = 4
"""Most late arms that the line names."""


def inference_of(records: Sequence[PairRecord], protocol: Json) -> Inference:
    """Return the protocol class of a run."""
    late: dict[str, dict[str, None]] = {}
    for record in records:
        for name, arm in record.arms.items():
            late.setdefault(name, {}).update(dict.fromkeys(_latencies(arm)))
    if not records:
        asked = protocol.get("latency")
        late = {name: {} if asked is None else {asked: None} for name in (BASE, DYNAMIC)}
    arms = {name: [*texts] for name, texts in late.items() if texts}
    whole = len({tuple(texts) for texts in late.values()}) == 1
    world: Literal["paused", "goes on"] = "goes on" if arms.keys() & {BASE, DYNAMIC} else "paused"
    hz = records[0].control_hz if records else CONTROL_HZ
    return Inference(world=world, late=arms, text=_text(arms, whole, hz))


def _latencies(arm: ArmRecord) -> Iterator[str]:
    """Yield the latency of an arm, and those that begin at a change of its schedule."""
    if arm.latency is not None:
        yield arm.latency
    for entry in arm.schedule:
        change: Any = entry.get("change") or {}
        if change.get("operation") == CHANGED_BY and change.get("latency"):
            yield f"{change['latency']} from a change on"


def _text(arms: Json, whole: bool, hz: int) -> str:
    if not arms:
        return "Protocol class: world paused during inference (each answer is there at once)."
    if whole:
        words = _words(arms[BASE], hz)
        return f"Protocol class: latency as an arm; the world goes on during inference, {words}."
    named = [f"{name} ({_words(texts, hz)})" for name, texts in [*arms.items()][:_NAMED]]
    more = [counted(len(arms) - _NAMED, "more arm")] if len(arms) > _NAMED else []
    return f"Protocol class: latency as an arm in {', '.join([*named, *more])}; world paused in all others."


def _words(texts: Sequence[str], hz: int) -> str:
    """Return latencies in words, for example ``4 steps (200 ms) late, asynchronous``."""
    return " or ".join(_latency_words(text, hz) for text in texts)


def _latency_words(text: str, hz: int) -> str:
    amount, _, begin = text.partition(" ")
    latency = Latency.parse(amount)
    steps = ("up to " if latency.drawn else "") + counted(latency.steps, "step")
    how = "the robot waits" if latency.runner == "sync" else "asynchronous"
    return f"{steps} ({1000 * latency.steps // hz} ms) late{' ' * bool(begin)}{begin}, {how}"
