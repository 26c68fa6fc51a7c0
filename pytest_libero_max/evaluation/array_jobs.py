"""Shard of a job of an array, from the environment variables of its scheduler."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pytest_libero_max.errors import counted

COUNT = "LIBERO_MAX_SHARDS"
"""Variable with the number of shards, for a scheduler that sets none for the whole array."""


@dataclass(frozen=True)
class Scheduler:
    """Numbering of the jobs of an array by a scheduler.

    Attributes:
        name: For messages.
        index: Variable with the number of this job.
        cure: Option that numbers an array so that its jobs are shards 1 to N.
        first: The number of the first job, or the variable that has it.
        last: Variable with the number of the last job; None where there is none.
        step: Variable with the step between two numbers; None where it is 1.
        count: Variable with the number of jobs; None where there is none.
    """

    name: str
    index: str
    cure: str
    first: int | str = 1
    last: str | None = None
    step: str | None = None
    count: str | None = None


SCHEDULERS = (
    Scheduler(
        "Slurm",
        "SLURM_ARRAY_TASK_ID",
        "sbatch --array=1-N",
        "SLURM_ARRAY_TASK_MIN",
        "SLURM_ARRAY_TASK_MAX",
        "SLURM_ARRAY_TASK_STEP",
        "SLURM_ARRAY_TASK_COUNT",
    ),
    Scheduler("Kubernetes", "JOB_COMPLETION_INDEX", "completionMode: Indexed", 0),
    Scheduler(
        "AWS Batch", "AWS_BATCH_JOB_ARRAY_INDEX", "an array size of N", 0, count="AWS_BATCH_JOB_ARRAY_SIZE"
    ),
    Scheduler("PBS", "PBS_ARRAY_INDEX", "qsub -J 1-N"),
    Scheduler("Torque", "PBS_ARRAYID", "qsub -t 1-N"),
    Scheduler("LSF", "LSB_JOBINDEX", 'bsub -J "name[1-N]"', 1, "LSB_JOBINDEX_END", "LSB_JOBINDEX_STEP"),
    Scheduler(
        "Grid Engine", "SGE_TASK_ID", "qsub -t 1-N", "SGE_TASK_FIRST", "SGE_TASK_LAST", "SGE_TASK_STEPSIZE"
    ),
)

_NO_ARRAY = {"LSB_JOBINDEX": "0", "SGE_TASK_ID": "undefined"}
"""Value of a variable in a job that is of no array."""


def shard_of_job(environment: Mapping[str, str]) -> tuple[int, int]:
    """Return the shard of this job and the number of shards, from 1.

    Raises:
        ValueError: This is no job of an array, or its place in the array is not known.
    """
    scheduler = next((known for known in SCHEDULERS if _in_array(known, environment)), None)
    if scheduler is None:
        variables = ", ".join(known.index for known in SCHEDULERS)
        raise ValueError(f"this is no job of an array: none of {variables} is set. Write I/N")
    index = _number(environment, scheduler.index)
    if environment.get(COUNT):
        count = _number(environment, COUNT)
        index = index + 1 if scheduler.first == 0 else index
    else:
        index, count = _place(scheduler, environment, index)
    if not 1 <= index <= count:
        raise ValueError(
            f"{scheduler.name} says job {index} where there are {counted(count, 'shard')}. Number the array "
            f"from 1 ({scheduler.cure}), or write I/N"
        )
    return index, count


def _in_array(scheduler: Scheduler, environment: Mapping[str, str]) -> bool:
    value = environment.get(scheduler.index, "")
    return value not in ("", _NO_ARRAY.get(scheduler.index))


def _place(scheduler: Scheduler, environment: Mapping[str, str], index: int) -> tuple[int, int]:
    """Return the place of a job among those that its scheduler knows of, and their number."""
    first = scheduler.first if isinstance(scheduler.first, int) else _number(environment, scheduler.first)
    step = 1 if scheduler.step is None else _number(environment, scheduler.step, 1)
    count = None if scheduler.count is None else _number(environment, scheduler.count)
    if scheduler.last is not None and step > 0:
        regular = (_number(environment, scheduler.last) - first) // step + 1
        if count not in (None, regular) or (index - first) % step:
            raise ValueError(
                f"{scheduler.name} plays a part of an array. Set {COUNT} to the number of all shards, and "
                f"number the array from 1 ({scheduler.cure})"
            )
        count = regular
    if count is None:
        raise ValueError(f"{scheduler.name} does not say how many jobs there are. Set {COUNT}")
    if count == 1 and index > 1:
        raise ValueError(
            f"{scheduler.name} plays job {index} of an array alone, which would be all pairs. Set {COUNT} to "
            "the number of all shards, or write I/N"
        )
    return (index - first) // step + 1, count


def _number(environment: Mapping[str, str], name: str, default: int | None = None) -> int:
    text = environment.get(name, "")
    if not text and default is not None:
        return default
    if not (text.isascii() and text.isdigit()):
        raise ValueError(f"{name}={text!r} is no number. Write I/N")
    return int(text)
