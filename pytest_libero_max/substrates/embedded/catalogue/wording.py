"""Other words for the same task, from a small grammar over its verbs, objects and places.

An instruction is taken apart into steps; each of four styles says the steps anew. Nothing in the words
depends on, or names, the variation they belong to.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from pytest_libero_max.errors import ManifestError
from pytest_libero_max.substrates.variation import pick

STYLES = ("synonyms", "paraphrase", "distraction", "reasoning")
"""From the mildest to the hardest to follow."""

PER_STYLE = MappingProxyType({"synonyms": 8, "paraphrase": 8, "distraction": 18, "reasoning": 16})
"""Number of the fifty rewritings of a task in each style: LIBERO-Plus's own shares."""

_PLACES = r"(?:on top of|on|in|to the right of|to the front of)"


@dataclass(frozen=True)
class Step:
    """One thing to do: ``verb`` is move, push, open, close or start; ``place`` is where to, if anywhere."""

    verb: str
    thing: str
    place: str = ""

    @property
    def pronoun(self) -> str:
        return "them" if self.thing.startswith("both ") else "it"


@dataclass(frozen=True)
class Rewording:
    """An instruction in other words, and the style they are in."""

    words: str
    style: str


def steps_of(language: str) -> tuple[Step, ...]:
    """Take an instruction apart, or raise ManifestError."""
    patterns: tuple[tuple[str, Callable[[re.Match[str]], tuple[Step, ...]]], ...] = (
        (r"pick up (.+) and place it (.+)", lambda m: (Step("move", m[1], m[2]),)),
        (
            r"turn on (.+) and put (.+) on it",
            lambda m: (Step("start", m[1]), Step("move", m[2], f"on {m[1]}")),
        ),
        (r"open (.+) and put (.+) inside", lambda m: (Step("open", m[1]), Step("move", m[2], f"in {m[1]}"))),
        (r"put (.+?) (in (.+)) and close it", lambda m: (Step("move", m[1], m[2]), Step("close", m[3]))),
        (
            rf"put (.+?) ({_PLACES} .+) and put (.+?) ({_PLACES} .+)",
            lambda m: (Step("move", m[1], m[2]), Step("move", m[3], m[4])),
        ),
        (r"push (.+?) (to .+)", lambda m: (Step("push", m[1], m[2]),)),
        (rf"put (.+?) ({_PLACES} .+)", lambda m: (Step("move", m[1], m[2]),)),
        (r"open (.+)", lambda m: (Step("open", m[1]),)),
        (r"turn on (.+)", lambda m: (Step("start", m[1]),)),
    )
    for pattern, build in patterns:
        match = re.fullmatch(pattern, language)
        if match:
            return build(match)
    raise ManifestError.seen(
        "instruction", language, " is not built like one of LIBERO's and cannot be reworded."
    )


def rewordings(language: str) -> tuple[Rewording, ...]:
    """Fifty different rewritings of an instruction, in the order of the styles, or raise ManifestError."""
    steps = steps_of(language)
    result: dict[str, Rewording] = {}
    for style, count in PER_STYLE.items():
        wanted = len(result) + count
        attempt = 0
        while len(result) < wanted:
            words = _SAYINGS[style](steps, (language, style, attempt))
            if words != language:
                result.setdefault(words, Rewording(words, style))
            attempt += 1
    return tuple(result.values())


def paraphrase(language: str) -> str:
    """One plain rewriting, by other verbs alone."""
    return next(words.words for words in rewordings(language) if words.style == "synonyms")


_TAKE = ("pick up", "grab", "take", "lift", "fetch", "get hold of")
_LEAVE = ("place", "put", "set", "lay", "leave", "deposit")
_PUSH = ("push", "slide", "shove", "nudge", "move")
_OPEN = ("open", "pull open", "draw out", "slide out")
_CLOSE = ("close", "shut", "push shut")
_START = ("turn on", "switch on", "start", "activate")


def _command(step: Step, seed: Sequence[object]) -> str:
    """Return a step as an imperative, verbs drawn anew."""
    if step.verb == "move":
        take, leave = pick(_TAKE, *seed, "take"), pick(_LEAVE, *seed, "leave")
        return f"{take} {step.thing} and {leave} {step.pronoun} {step.place}"
    verbs = {"push": _PUSH, "open": _OPEN, "close": _CLOSE, "start": _START}[step.verb]
    words = f"{pick(verbs, *seed, step.verb)} {step.thing}"
    return f"{words} {step.place}" if step.place else words


def _outcome(step: Step) -> str:
    """Clause for the result of a step."""
    many = step.pronoun == "them"
    if step.verb in ("move", "push"):
        place = step.place.replace("to the front", "at the front", 1)
        return f"{step.thing} {'are' if many else 'is'} {place}"
    return f"{step.thing} is {({'open': 'open', 'close': 'closed', 'start': 'running'})[step.verb]}"


def _commands(steps: Sequence[Step], seed: Sequence[object]) -> str:
    link = pick((" and then ", ", then ", "; after that, "), *seed, "link")
    return link.join(_command(step, (*seed, number)) for number, step in enumerate(steps))


def _say_synonyms(steps: Sequence[Step], seed: Sequence[object]) -> str:
    lead = pick(("", "now ", "go and ", "next, "), *seed, "lead")
    return lead + _commands(steps, seed)


def _say_paraphrase(steps: Sequence[Step], seed: Sequence[object]) -> str:
    if pick((True, False), *seed, "outcome"):
        frame = pick(
            (
                "make sure that {}",
                "see to it that in the end {}",
                "the job is done once {}",
                "what i want is that {}",
                "arrange things so that {}",
                "please work until {}",
            ),
            *seed,
            "frame",
        )
        return frame.format(" and ".join(_outcome(step) for step in steps))
    frame = pick(
        (
            "could you please {}?",
            "i would like you to {}",
            "your task is to {}",
            "would you be so kind as to {}?",
            "help me out: {}",
            "it is time to {}",
        ),
        *seed,
        "frame",
    )
    return frame.format(_commands(steps, seed))


def _say_distraction(steps: Sequence[Step], seed: Sequence[object]) -> str:
    before = pick(
        (
            "the guests will arrive in an hour and much is left to do, so ",
            "although there are other things around, ",
            "i have just come back from the market and feel tired; ",
            "while the kettle is heating up, ",
            "my brother tidied the cupboards yesterday, but never mind that: ",
            "it is raining outside and the radio is on; meanwhile, ",
            "somebody may ask for the newspaper later, yet for now ",
            "after breakfast the room always looks like this; ",
        ),
        *seed,
        "before",
    )
    after = pick(
        (
            "",
            ", and leave the rest as it is",
            ", nothing else has to be touched",
            "; the floor was swept this morning",
            ", no matter what else you see",
            "; supper can wait",
        ),
        *seed,
        "after",
    )
    return f"{before}{_commands(steps, seed)}{after}"


def _say_reasoning(steps: Sequence[Step], seed: Sequence[object]) -> str:
    opening = pick(
        ("let us think it through: ", "step by step: ", "here is the plan: ", "do it in this order: "),
        *seed,
        "opening",
    )
    parts = [part for number, step in enumerate(steps) for part in _thoughts(step, (*seed, number))]
    links = ("first, ", *["then "] * (len(parts) - 2), "finally, ")
    return opening + "; ".join(link + part for link, part in zip(links, parts, strict=True))


def _thoughts(step: Step, seed: Sequence[object]) -> list[str]:
    look = pick(("look for {}", "find {}", "locate {}", "work out which one is {}"), *seed, "look")
    looking = look.format(step.thing)
    if step.verb == "move":
        hold = pick(
            ("bring the gripper over {} and close the fingers", "take hold of {}", "grasp {} firmly"),
            *seed,
            "hold",
        )
        carry = pick(
            (
                "raise {} clear of everything",
                "carry {} over without bumping into anything",
                "lift {} high enough to pass",
            ),
            *seed,
            "carry",
        )
        let = pick(("let go of {it} {p}", "set {it} down {p}", "release {it} {p}"), *seed, "let")
        return [
            looking,
            hold.format(step.pronoun),
            carry.format(step.pronoun),
            let.format(it=step.pronoun, p=step.place),
        ]
    reach = pick(("reach for {}", "bring the gripper to {}", "put a finger to {}"), *seed, "reach")
    return [looking, reach.format(step.pronoun), _command(step, seed)]


_SAYINGS: Mapping[str, Callable[[Sequence[Step], Sequence[object]], str]] = MappingProxyType(
    {
        "synonyms": _say_synonyms,
        "paraphrase": _say_paraphrase,
        "distraction": _say_distraction,
        "reasoning": _say_reasoning,
    }
)
