from __future__ import annotations

import pytest

from pytest_libero_max.evaluation.array_jobs import shard_of_job


def _slurm(job: int, count: int) -> dict[str, str]:
    return {"SLURM_ARRAY_TASK_ID": str(job), "SLURM_ARRAY_TASK_COUNT": str(count)}


@pytest.mark.parametrize(
    ("environment", "place"),
    [
        (_slurm(1, 4), (1, 4)),
        ({**_slurm(3, 1), "LIBERO_MAX_SHARDS": "8"}, (3, 8)),
        ({"JOB_COMPLETION_INDEX": "0", "LIBERO_MAX_SHARDS": "3"}, (1, 3)),
        ({"AWS_BATCH_JOB_ARRAY_INDEX": "2", "AWS_BATCH_JOB_ARRAY_SIZE": "3"}, (3, 3)),
        ({"PBS_ARRAY_INDEX": "2", "LIBERO_MAX_SHARDS": "3"}, (2, 3)),
        ({"PBS_ARRAYID": "3", "LIBERO_MAX_SHARDS": "3"}, (3, 3)),
        ({"LSB_JOBINDEX": "5", "LSB_JOBINDEX_END": "6"}, (5, 6)),
        ({"LSB_JOBINDEX": "0", **_slurm(2, 2)}, (2, 2)),
        ({"SGE_TASK_ID": "4", "SGE_TASK_LAST": "8"}, (4, 8)),
    ],
)
def test_a_job_of_an_array_knows_its_shard(environment: dict[str, str], place: tuple[int, int]) -> None:
    assert shard_of_job(environment) == place


@pytest.mark.parametrize(
    ("environment", "message"),
    [
        ({}, "SLURM_ARRAY_TASK_ID, JOB_COMPLETION_INDEX, "),
        ({"SGE_TASK_ID": "undefined", "LSB_JOBINDEX": "0"}, "no job"),
        (_slurm(3, 1), "Slurm.* 3 .* 1 shard.*LIBERO_MAX_SHARDS"),
        (_slurm(0, 4), "Slurm.* 0 .*--array=1-N"),
        ({"JOB_COMPLETION_INDEX": "1"}, "Kubernetes.*LIBERO_MAX_SHARDS"),
        ({"JOB_COMPLETION_INDEX": "3", "LIBERO_MAX_SHARDS": "3"}, "Kubernetes .* 4 .* 3"),
        ({"PBS_ARRAY_INDEX": "-1", "LIBERO_MAX_SHARDS": "3"}, "PBS_ARRAY_INDEX='-1'"),
    ],
)
def test_a_job_whose_shard_is_not_known_is_told_so(environment: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        shard_of_job(environment)
