from __future__ import annotations

import pytest

from pytest_libero_max.evaluation.array_jobs import shard_of_job


def _slurm(job: int, first: int, last: int, step: int = 1, count: int | None = None) -> dict[str, str]:
    count = (last - first) // step + 1 if count is None else count
    names = {"ID": job, "MIN": first, "MAX": last, "STEP": step, "COUNT": count}
    return {f"SLURM_ARRAY_TASK_{name}": str(value) for name, value in names.items()}


@pytest.mark.parametrize(
    ("environment", "place"),
    [
        (_slurm(1, 1, 4), (1, 4)),
        (_slurm(3, 0, 3), (4, 4)),
        (_slurm(7, 1, 7, 2), (4, 4)),
        ({**_slurm(3, 3, 3), "LIBERO_MAX_SHARDS": "8"}, (3, 8)),
        ({**_slurm(7, 3, 7, 1, 2), "LIBERO_MAX_SHARDS": "8"}, (7, 8)),
        ({"JOB_COMPLETION_INDEX": "0", "LIBERO_MAX_SHARDS": "3"}, (1, 3)),
        ({"AWS_BATCH_JOB_ARRAY_INDEX": "2", "AWS_BATCH_JOB_ARRAY_SIZE": "3"}, (3, 3)),
        ({"PBS_ARRAY_INDEX": "2", "LIBERO_MAX_SHARDS": "3"}, (2, 3)),
        ({"PBS_ARRAYID": "3", "LIBERO_MAX_SHARDS": "3"}, (3, 3)),
        ({"LSB_JOBINDEX": "5", "LSB_JOBINDEX_END": "6"}, (5, 6)),
        ({"LSB_JOBINDEX": "0", **_slurm(2, 1, 2)}, (2, 2)),
        (
            {"SGE_TASK_ID": "4", "SGE_TASK_FIRST": "2", "SGE_TASK_LAST": "8", "SGE_TASK_STEPSIZE": "2"},
            (2, 4),
        ),
    ],
)
def test_a_job_of_an_array_knows_its_shard(environment: dict[str, str], place: tuple[int, int]) -> None:
    assert shard_of_job(environment) == place


@pytest.mark.parametrize(
    ("environment", "message"),
    [
        ({}, "this is no job of an array: none of SLURM_ARRAY_TASK_ID, JOB_COMPLETION_INDEX, "),
        ({"SGE_TASK_ID": "undefined", "LSB_JOBINDEX": "0"}, "this is no job of an array"),
        (_slurm(3, 3, 3), "Slurm plays job 3 of an array alone.*Set LIBERO_MAX_SHARDS"),
        (_slurm(7, 3, 7, 1, 2), "Slurm plays a part of an array. Set LIBERO_MAX_SHARDS"),
        ({"JOB_COMPLETION_INDEX": "1"}, "Kubernetes does not say how many jobs there are. Set LIBERO_MAX_"),
        ({"PBS_ARRAY_INDEX": "0", "LIBERO_MAX_SHARDS": "3"}, r"PBS says job 0 where .*\(qsub -J 1-N\)"),
        ({"JOB_COMPLETION_INDEX": "3", "LIBERO_MAX_SHARDS": "3"}, "Kubernetes says job 4 where there are 3"),
        ({"PBS_ARRAY_INDEX": "-1", "LIBERO_MAX_SHARDS": "3"}, "PBS_ARRAY_INDEX='-1' is no number"),
    ],
)
def test_a_job_whose_shard_is_not_known_is_told_so(environment: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        shard_of_job(environment)
