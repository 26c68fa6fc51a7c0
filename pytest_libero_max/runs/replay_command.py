"""The command that plays a case of a run again, just as the run did."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.documents import Json

if TYPE_CHECKING:
    from pytest_libero_max.runs.outcomes import RunOutcomes
    from pytest_libero_max.runs.store import StoredRun

OUTPUT = "libero-max-replay"
"""Output folder of the replayed pair, so that the run itself is not set aside."""

_SUBSTRATE = {
    "semantics": "semantics",
    "instruction_source": "instruction",
    "source_variations": "source-variations",
    "assets": "libero-assets",
}
"""Options by the part of a substrate's description that holds their values."""


def replay_command(run: StoredRun | RunOutcomes) -> list[str]:
    """Return the command that plays one case of a run again, once the case's item id is appended.

    It gives the same record in the folder in which the run was started, on a machine with the same files.
    """
    provenance = run.run.provenance
    policy, cases, substrate = (provenance[name] for name in ("policy", "case_set", "substrate"))
    kind, _, name = cases["name"].partition(" ")
    options: list[tuple[str, object]] = [("policy", policy["reference"]), ("profile", policy.get("profile"))]
    options.append(("revision", policy.get("revision")))
    if kind in ("track", "manifest") and name:
        options.append((kind, cases.get("path", name)))
    options.append(("program", cases.get("program")))
    options.append(("substrate", substrate["name"]))
    options += [("libero", root) for root in substrate.get("roots", ())]
    options += [(option, substrate.get(part)) for part, option in _SUBSTRATE.items()]
    options.append(("prefix", provenance["protocol"].get("prefix")))
    options += [("horizon", policy.get("horizon")), ("query-interval", policy.get("query_interval"))]
    options.append(("latency", provenance["protocol"].get("latency")))
    study = provenance["protocol"].get("study") or {}
    options += [("strength", provenance["protocol"].get("strength"))]
    settings = "delays" if study.get("name") == "latency" else "cadence"
    options += [("study", study.get("name")), (settings, study.get("settings"))]
    options += [(name, policy.get(name)) for name in ("restore", "adaptive")]
    options.append(("sham", provenance["protocol"].get("sham")))
    options += _noise_floor(provenance)
    options.append(("output", OUTPUT))
    return ["pytest", *(f"--libero-max-{name}={value}" for name, value in options if value is not None), "-k"]


def _noise_floor(provenance: Json) -> list[tuple[str, object]]:
    """Return options that select the same pairs to play Base twice: the number asked for, and omissions."""
    noise_floor = provenance["protocol"].get("noise_floor")
    if noise_floor is None:
        return []
    shards = (provenance.get("selection") or {}).get("shards")
    shard = f"{shards['present'][0]}/{shards['of']}" if shards and len(shards["present"]) == 1 else None
    return [
        ("noise-floor", noise_floor),
        ("limit", provenance["case_set"].get("limit")),
        ("shard", shard),
    ]
