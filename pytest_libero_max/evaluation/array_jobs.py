"""Shard of a job of an array, from the environment variables of its scheduler."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pytest_libero_max.errors import counted

COUNT = "LIBERO_MAX_SHARDS"
"""Variable with the number of shards: for a scheduler that sets none, and for a part of an array."""


@dataclass(frozen=True)
class Scheduler:
    """Numbering of the jobs of an array by a scheduler."""

    name: str
    index: str
    cure: str
    """Option that numbers an array so that its jobs are shards 1 to N."""
    first: int = 1
    count: str = COUNT


SCHEDULERS = (
    Scheduler("Slurm", "SLURM_ARRAY_TASK_ID", "sbatch --array=1-N", count="SLURM_ARRAY_TASK_COUNT"),
    Scheduler("Kubernetes", "JOB_COMPLETION_INDEX", "completionMode: Indexed", first=0),
    Scheduler("AWS Batch", "AWS_BATCH_JOB_ARRAY_INDEX", "an array size of N", 0, "AWS_BATCH_JOB_ARRAY_SIZE"),
    Scheduler("PBS", "PBS_ARRAY_INDEX", "qsub -J 1-N"),
    Scheduler("Torque", "PBS_ARRAYID", "qsub -t 1-N"),
    Scheduler("LSF", "LSB_JOBINDEX", 'bsub -J "name[1-N]"', count="LSB_JOBINDEX_END"),
    Scheduler("Grid Engine", "SGE_TASK_ID", "qsub -t 1-N", count="SGE_TASK_LAST"),
)

_NO_ARRAY = {"LSB_JOBINDEX": "0", "SGE_TASK_ID": "undefined"}
"""Value of a variable in a job that is of no array."""


def shard_of_job(environment: Mapping[str, str]) -> tuple[int, int]:
    """Return the shard of this job and the number of shards, from 1, or raise ValueError."""
    scheduler = next((known for known in SCHEDULERS if _in_array(known, environment)), None)
    if scheduler is None:
        variables = ", ".join(known.index for known in SCHEDULERS)
        raise ValueError(f"this is no job of an array: none of {variables} is set. Write I/N")
    index = _number(environment, scheduler.index) + 1 - scheduler.first
    variable = COUNT if environment.get(COUNT) else scheduler.count
    if not environment.get(variable):
        raise ValueError(f"{scheduler.name} does not say how many jobs there are. Set {COUNT}")
    count = _number(environment, variable)
    if not 1 <= index <= count:
        raise ValueError(
            f"{scheduler.name} says job {index} where there are {counted(count, 'shard')}. Number the array "
            f"from 1 ({scheduler.cure}), set {COUNT} to the number of all shards, or write I/N"
        )
    return index, count


def _in_array(scheduler: Scheduler, environment: Mapping[str, str]) -> bool:
    return environment.get(scheduler.index, "") not in ("", _NO_ARRAY.get(scheduler.index))


def _number(environment: Mapping[str, str], name: str) -> int:
    text = environment[name]
    if not (text.isascii() and text.isdigit()):
        raise ValueError(f"{name}={text!r} is no number. Write I/N")
    return int(text)
