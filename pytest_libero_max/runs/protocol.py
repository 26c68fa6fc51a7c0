"""Settings that may change a result, and what the provenance of a run says of them.

``protocol`` and ``policy`` hold values by the names of fields, and a field's declaration says the rest. One
that is not declared here, of a run of another version, is taken for a setting of its name.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.latency import NO_LATENCY, Latency
from pytest_libero_max.benchmark.structs import Object, Positive, Share, Text, checked, rule
from pytest_libero_max.benchmark.text_values import fraction, known_in, named_values, positive, text
from pytest_libero_max.errors import ReportError
from pytest_libero_max.pairing.probes.registry import PROBES
from pytest_libero_max.pairing.record import LatencyText
from pytest_libero_max.policies.wrappers import WRAPPERS, setting_of
from pytest_libero_max.runs.setting import ALWAYS, Part, Recorded, options_of, setting
from pytest_libero_max.studies.registry import FILES, STUDIES

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.programs import Program
    from pytest_libero_max.studies.study import Study

RECORDED_RUN = "recorded:"
"""Begins the text of a latency that is read from a run."""

_HEADER = ("reference", "code", "servers", "published")
"""Fields of a policy in the provenance that say where it comes from and are no settings."""

_WRAPPERS_BEFORE = ("restore", "adaptive")
"""Fields of a policy in the provenance of earlier runs, each the setting of one wrapper."""

PARTS: tuple[Part, ...] = ("protocol", "policy")

Texts = Annotated[dict[Text, Text], rule("an object of texts")]


@dataclass(frozen=True)
class Noise:
    """Pairs that are played again to measure chance."""

    sham: float | None = None
    """Share of the pairs that also play a sham event; None for what the policy calls for."""
    floor: int | None = None
    """Number of pairs whose Base is played twice."""

    def __str__(self) -> str:
        given = {"sham": self.sham, "floor": self.floor}
        return ",".join(f"{name}:{value}" for name, value in given.items() if value is not None) or "none"


def _named_or_none(
    text: str, parsers: Mapping[str, Any], known: Collection[str] | None = None
) -> dict[str, Any]:
    """Parse values by name; ``none`` takes back those of an ini file."""
    return {} if text.strip() == "none" else named_values(text, ":", parsers, known)


def _noise(text: str) -> Noise:
    return Noise(**_named_or_none(text, {"sham": fraction, "floor": positive}))


def _noise_recorded() -> Mapping[str, Recorded]:
    return {
        "noise_floor": Recorded(
            "protocol",
            Positive,
            lambda noise: noise.floor,
            usual=ALWAYS,
            alters=False,
            kind="added",
            option="floor:{}".format,
            of_selection=True,
        ),
        "sham": Recorded(
            "protocol",
            Share,
            lambda noise: noise.sham,
            alters=False,
            kind="added",
            option="sham:{}".format,
        ),
    }


def _wrap(text: str) -> dict[str, str]:
    """Parse wrappers with their settings, in the order in which they are put on, which is not the text's."""

    def reader(name: str) -> Any:
        return lambda mode: known_in(WRAPPERS[name].modes)(mode)

    modes = _named_or_none(text, {name: reader(name) for name in WRAPPERS}, WRAPPERS)
    return dict(sorted(modes.items(), reverse=True))


def _wrap_played(spec: Json, asked: Mapping[str, str] | None) -> dict[str, str] | None:
    """Return the wrappers around a policy, without those of an adapter's own that no package offers."""
    played = dict(map(setting_of, spec.get("wrappers", ())))
    return {name: played[name] for name in played if name in WRAPPERS or name in (asked or {})} or None


def _of_spec(name: str) -> Callable[[Json, Any], Any]:
    return lambda spec, _: spec.get(name)


_SOME_HZ = 1
"""Control rate with which only the form of a latency is checked."""


def _latency(text: str) -> Latency | str:
    """Parse the time that a query takes; milliseconds and the records of a run wait for the control rate."""
    if text.startswith(RECORDED_RUN):
        return text
    latency = Latency.parse(text, _SOME_HZ)
    return text if "ms" in text else latency


def _study(text: str) -> str:
    """Check the name of a study, with settings behind a colon; a file is read later."""
    if not text.endswith(FILES):
        known_in(STUDIES)(text.partition(":")[0])
    return text


@dataclass(frozen=True)
class ProtocolSettings:
    """Settings that may change a result."""

    profile: str | None = setting(
        "NAME|PATH",
        "Profile of the policy behind a server's address: one of this package, or a TOML file",
        text,
        recorded=Recorded("policy", Text, kind="place", option=None),
    )
    revision: str | None = setting(
        "TEXT",
        "Identity of the weights behind servers, for example a checkpoint's digest; runs over other "
        "addresses that declare the same are one measurement",
        text,
        recorded=Recorded("policy", Text),
    )
    program: Program | None = setting(
        "NAME|FILE",
        "Lay a program over the cases that it fits: which arms are played and what happens in them. One of "
        "`libero-max list programs`, or a JSON or TOML file",
        text,
        recorded=Recorded(
            "protocol",
            Object,
            lambda program: program and {**program.to_dict(), "digest": program.digest},
            option=None,
        ),
    )
    prefix: Literal["fork", "replay"] = setting(
        "MODE",
        "Way of Dynamic to the event: fork (from a snapshot taken in Base) or "
        "replay (the recorded actions, from reset)",
        known_in(("fork", "replay")),
        default="fork",
        recorded=Recorded("protocol", Text, alters=False),
    )
    strength: float = setting(
        "FRACTION",
        "Let every event happen at this share of its change, 0 to 1; refused for events that happen whole or "
        "not at all",
        fraction,
        default=1.0,
        recorded=Recorded("protocol", Share, usual=1.0),
    )
    study: Study | None = setting(
        "NAME[:SETTINGS]|FILE",
        "Play the arms of a study as well, and report them: camera-timing, camera-strength (both of the "
        "track camera unless another one is named), event-timing, audit, cadence:2,4,8 (values of Q) or "
        "cadence:2/2,4/4 (H/Q), latency:1,2,4,8 (steps that a query takes; 4sync for the runner that waits; "
        "both of the track lite, and always beside the policy's own), repeats or repeats:PLAYS (of the track "
        "smoke: each case 3 or so many times, with other seeds of the policy), continue:a.py,b.py (of the "
        "track lite: these policies go on from the event after the prefix of the run's), one of another "
        "package, or a JSON or TOML file that spells one",
        _study,
        recorded=Recorded("protocol", Object, lambda study: study and study.to_dict(), option=None),
    )
    probe: tuple[str, ...] = setting(
        "NAME",
        "Read this in every arm as well, and keep its columns in the records; may be repeated "
        "(contact_timeline, or a probe of another package)",
        known_in(PROBES),
        many=True,
        group="protocol",
    )
    latency: Latency = setting(
        "TIME",
        "Let the world go on while the policy is asked: 200ms or 4steps (of 50 ms for LIBERO, rounded up). "
        "The robot goes on with the chunk before, and drops the actions of the new one that are late "
        "(asynchronous inference); with ,sync behind it, it waits for the answer. recorded:RUN draws the "
        "delay of each query from the query times of a run",
        _latency,
        recorded=Recorded(
            "protocol",
            LatencyText,
            lambda latency: None if latency == NO_LATENCY else str(latency),
        ),
    )
    horizon: int | None = setting(
        "ACTIONS",
        "Override H (chunk size), the most actions a query returns",
        positive,
        recorded=Recorded("policy", Positive, usual=ALWAYS, as_played=_of_spec("horizon")),
    )
    query_interval: int | None = setting(
        "ACTIONS",
        "Override Q (execution horizon, replan steps), the actions executed before the next query",
        positive,
        recorded=Recorded("policy", Positive, usual=ALWAYS, as_played=_of_spec("query_interval")),
    )
    wrap: Mapping[str, str] = setting(
        "restore:MODE,adaptive:WATCH",
        "Put wrappers around the policy, in the order of their names, the last one innermost: restore "
        "repairs images before the policy sees them, by what they show alone, gated (those that look "
        "damaged) or always; adaptive executes whole chunks and asks early where something changed, on "
        "average no oftener than every Q steps, watching the fixed cameras (image) or the objects "
        "(privileged); or one of another package; none for none",
        _wrap,
        default={},
        recorded=Recorded(
            "policy",
            Texts,
            lambda modes: dict(modes) or None,
            as_played=_wrap_played,
            hides=("horizon", "query_interval"),
            option=lambda modes: ",".join(map(":".join, modes.items())),
        ),
    )
    noise: Noise = setting(
        "sham:SHARE,floor:PAIRS",
        "Measure chance, by one or both of: sham, the share of the pairs, 0 to 1, that also play a sham "
        "event, at whose moment the policy is given other seeds and nothing changes, and Dynamic with other "
        "seeds as well, so that what is lost by the policy's own chance is known (default: 0.2 for a policy "
        "that is not repeatable, else 0); floor, the number of pairs, a stratified subset, whose Base is "
        "played twice, to report how often it flips",
        _noise,
        default=Noise(),
        recorded=_noise_recorded,
    )

    def recorded(self, part: Part) -> Json:
        """Return what the provenance of a run says in one of its parts, by field."""
        contents = {
            name: (recorded, recorded.value(getattr(self, option.field)))
            for option in options_of(type(self))
            for name, recorded in option.records.items()
            if recorded.part == part
        }
        return {name: value for name, (recorded, value) in contents.items() if value != recorded.usual}

    @property
    def played(self) -> dict[str, str]:
        """What each record says of the settings it was played with, among its fingerprints."""
        return played_settings(self.recorded("protocol"))

    @property
    def extras(self) -> str:
        """Words for pytest's header; empty for a plain run."""
        policy = self.recorded("policy")
        asked = [
            f"{name.replace('_', ' ')} {field.option(policy[name])}"
            for name, field in declared("policy").items()
            if field.as_played and field.option and policy.get(name) is not None
        ]
        return "".join(
            f", {words}" for words in (*protocol_words(self.recorded("protocol")).values(), *asked)
        )


DECLARED = options_of(ProtocolSettings)
"""The settings that may change a result, in the order of the help."""


def declared(part: Part) -> dict[str, Recorded]:
    """Return the fields of a part of the provenance that hold settings, by name."""
    return {
        name: recorded
        for option in DECLARED
        for name, recorded in option.records.items()
        if recorded.part == part
    }


def renamed(policy: Json) -> Json:
    """Return a policy's part of a provenance with the fields of earlier runs as they are written now."""
    modes = {name: policy[name] for name in _WRAPPERS_BEFORE if isinstance(policy.get(name), str)}
    kept = {name: value for name, value in policy.items() if name not in _WRAPPERS_BEFORE}
    return {**kept, "wrap": modes} if modes else kept


def require_settings(provenance: Json) -> None:
    """Check the settings that a provenance names, or raise ReportError."""
    for part in PARTS:
        for name, recorded in declared(part).items():
            if provenance[part].get(name) is not None:
                checked(provenance[part][name], recorded.holds, f"provenance: {part}.{name}", ReportError)


def protocol_words(protocol: Json) -> dict[str, str]:
    """Return words for what makes a protocol another one than the usual, by the name of the setting."""
    known = declared("protocol")
    return {
        name: f"{name.replace('_', ' ')} {_shown(value)}"
        for name, value in protocol.items()
        if value is not None and (name not in known or known[name].alters)
    }


def option_values(provenance: Json) -> Iterator[tuple[str, str]]:
    """Yield the options that a provenance names, but for places, with their texts."""
    for part in PARTS:
        fields = {name: value for name, value in provenance[part].items() if value is not None}
        for option in DECLARED:
            given = {name: fields.pop(name) for name in fields.keys() & option.records.keys()}
            texts = [
                field.option(given[name])
                for name, field in option.records.items()
                if name in given and field.option is not None
            ]
            if texts:
                yield option.name, ",".join(texts)
        for name, value in fields.items():
            if name not in _HEADER:
                yield name.replace("_", "-"), value


def depends_on_selection(provenance: Json) -> bool:
    """Return True if a setting's effect on a pair depends on the other pairs of the run."""
    return any(
        recorded.of_selection and provenance[part].get(name) is not None
        for part in PARTS
        for name, recorded in declared(part).items()
    )


def played_settings(protocol: Json) -> dict[str, str]:
    """Return what each record says of a protocol, among its fingerprints, by the name of the setting.

    Studies and programs are objects: the arms of a record say what they played.
    """
    return {
        name: fingerprint_text(protocol[name])
        for name in protocol_words(protocol)
        if not isinstance(protocol[name], dict)
    }


def fingerprint_text(value: Any) -> str:
    """Return the value of a setting as the fingerprints of a record hold it."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        digest = value.get("digest")
        return str(value["name"]) + (f" ({digest[:12]})" if digest else "")
    return fingerprint_text(value)
