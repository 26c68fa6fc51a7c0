"""Version 1 of the pair record: one pair as flat fields, without arms."""

from __future__ import annotations

from typing import Annotated, ClassVar

from msgspec import Struct

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.structs import (
    Count,
    Distance,
    Document,
    Flag,
    Object,
    Proof,
    Texts,
    convert,
    rule,
    shown,
)
from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.schedules import BASE, BASE_AGAIN, DYNAMIC


class _Repeat(Struct, frozen=True, forbid_unknown_fields=True):
    success: Flag
    identical: Flag


class _Contacts(Struct, frozen=True, forbid_unknown_fields=True):
    base: Texts
    dynamic: Texts


class _Flat(Document, frozen=True, kw_only=True):
    """The fields of version 1 that version 2 keeps in its arms."""

    NOUN: ClassVar[str] = "pair record of version 1"

    base_success: Flag
    dynamic_success: Flag
    base_steps: Count
    dynamic_steps: Count
    trigger_step: Count | None
    trigger_distance_m: Distance | None
    min_distance_m: Distance
    response_step: Count | None
    stale_actions: Count | None
    base_queries: Count
    dynamic_queries: Count
    prefix_digest: Proof | None
    base_digest: Proof
    dynamic_digest: Proof | None
    evidence: Object | None
    base_repeat: Annotated[_Repeat | None, rule("an object with success and identical, or null")]
    contacts: Annotated[_Contacts, rule("an object with the texts of base and dynamic")]


_FIELDS = _Flat.__struct_fields__


def from_version_1(values: Json) -> Json:
    """Return the fields of a record of version 1 as version 2 spells them.

    Raises:
        ReportError: It lacks a field, or fields contradict each other.
    """
    flat = {name: value for name, value in values.items() if name in _FIELDS}
    convert(flat, _Flat)
    interval = values["policy"].get("query_interval") if isinstance(values.get("policy"), dict) else None
    if type(interval) is not int or interval < 1:
        raise ReportError(
            f"policy={shown(values.get('policy'))} of a pair record, but must be a policy's spec with a "
            "query_interval of at least 1."
        )
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
                "says what it did."
            )
    else:
        # Of every answer Q actions are executed, so the steps tell how many queries there were.
        before = -(-values["trigger_step"] // interval)
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
