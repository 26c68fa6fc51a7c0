"""Version 1 of the pair record: one pair as flat fields, without arms."""

from __future__ import annotations

from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.schedules import BASE, BASE_AGAIN, DYNAMIC
from pytest_libero_max.pairing.fields import (
    COUNT,
    DISTANCE,
    FLAG,
    OBJECT,
    POLICY,
    PROOF,
    TEXTS,
    Rule,
    check_fields,
    shown,
)


def _is_repeat(value: Any) -> bool:
    return _has(value, {"success", "identical"}, FLAG)


def _is_contacts(value: Any) -> bool:
    return _has(value, {BASE, DYNAMIC}, TEXTS)


def _has(value: Any, names: set[str], rule: Rule) -> bool:
    return type(value) is dict and value.keys() == names and all(map(rule.holds, value.values()))


_FIELDS = {
    "base_success": FLAG,
    "dynamic_success": FLAG,
    "base_steps": COUNT,
    "dynamic_steps": COUNT,
    "trigger_step": COUNT.or_null,
    "trigger_distance_m": DISTANCE.or_null,
    "min_distance_m": DISTANCE,
    "response_step": COUNT.or_null,
    "stale_actions": COUNT.or_null,
    "base_queries": COUNT,
    "dynamic_queries": COUNT,
    "prefix_digest": PROOF.or_null,
    "base_digest": PROOF,
    "dynamic_digest": PROOF.or_null,
    "evidence": OBJECT.or_null,
    "base_repeat": Rule("an object with success and identical", _is_repeat).or_null,
    "contacts": Rule("an object with the texts of base and dynamic", _is_contacts),
}
"""The fields of version 1 that version 2 keeps in its arms."""


def from_version_1(values: Json) -> Json:
    """The fields of a record of version 1 as version 2 spells them.

    Raises:
        ReportError: It lacks a field, or fields contradict each other.
    """
    flat = {name: value for name, value in values.items() if name in _FIELDS}
    check_fields(flat, _FIELDS, f"pair record of version 1, case {shown(values.get('case_id'))},")
    if not POLICY.holds(values.get("policy")):
        raise ReportError(f"policy={values.get('policy')!r} of a pair record, but must be {POLICY.words}.")
    rest = {name: value for name, value in values.items() if name not in _FIELDS}
    base: Json = {
        "schedule": [],
        "repetition": 0,
        "success": values["base_success"],
        "steps": values["base_steps"],
        "queries": values["base_queries"],
        "firings": [],
        "response_step": None,
        "stale_actions": None,
        "min_distance_m": values["min_distance_m"],
        "clipped_components": None,
        "contacts": values["contacts"]["base"],
        "proof": values["base_digest"],
        "shares": None,
    }
    dynamic = {**base, "schedule": None, "shares": BASE}
    if values["trigger_step"] is None:
        untold = ("trigger_distance_m", "response_step", "stale_actions", "prefix_digest", "dynamic_digest")
        if flat["dynamic_success"] != flat["base_success"] or any(flat[name] is not None for name in untold):
            raise ReportError(
                f"{shown(values.get('case_id'))}: trigger_step=None, so the event never came, but the record "
                "says what came of it."
            )
    else:
        # Of every answer Q actions are executed, so the steps tell how many queries there were.
        before = -(-values["trigger_step"] // values["policy"]["query_interval"])
        firing = {
            "step": values["trigger_step"],
            "queries": before,
            "distance_m": values["trigger_distance_m"],
            "prefix_proof": values["prefix_digest"],
            "evidence": values["evidence"],
        }
        dynamic |= {
            "success": values["dynamic_success"],
            "steps": values["dynamic_steps"],
            "queries": before + values["dynamic_queries"],
            "firings": [firing],
            "response_step": values["response_step"],
            "stale_actions": values["stale_actions"],
            "min_distance_m": None,
            "contacts": values["contacts"]["dynamic"],
            "proof": values["dynamic_digest"],
            "shares": None,
        }
    arms = {BASE: base, DYNAMIC: dynamic}
    repeat = values["base_repeat"]
    if repeat is not None:
        again = {**base, "repetition": 1, "success": repeat["success"]}
        if not repeat["identical"]:
            again |= dict.fromkeys(("steps", "queries", "min_distance_m", "contacts", "proof"))
        arms[BASE_AGAIN] = again
    return {**rest, "arms": arms}
