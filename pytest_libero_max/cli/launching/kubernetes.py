"""Shards as an Indexed Job of Kubernetes."""

from __future__ import annotations

import argparse
import json
import re
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.cli.launching.shards import Shards, add_arguments, hand_over, require_lines
from pytest_libero_max.errors import OptionError
from pytest_libero_max.report.exit_status import GATE_FAILED, INCOMPLETE

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]

_RETRIES = 5
"""So often a shard is begun again after its pod has failed. Pods that Kubernetes itself takes away are not
counted."""

_NAME = re.compile(r"[a-z]([-a-z0-9]{0,48}[a-z0-9])?")
"""A name of a Job, short enough for the names of its pods."""

_SHARD = """\
export LIBERO_MAX_SHARDS={shards}
{beginning}{pytest}
status=$?
# These say that the shard has ended. With any other exit status it is begun again.
case "$status" in 0 | 1 | {gate_failed} | {incomplete}) ;; *) exit "$status" ;; esac
# Kubernetes knows no Job that waits for another one, so each shard tries, and the last one succeeds.
{merge} \\
    || echo "Exit status $? of the merge. The shard that ends last merges all; this one is kept."
# A pair that could not be measured is played again.
[ "$status" -ne {incomplete} ] || exit {incomplete}
"""

_MERGE = """\
{beginning}{merge} || [ $? -eq {incomplete} ]
"""


@dataclass(frozen=True)
class Pods:
    """What the pods are.

    Attributes:
        image: Of their container.
        claim: The claim of the volume that all share.
        mount: Where the volume is, in each of them.
        name: Of the Job.
        python: The interpreter in the image.
        cpus: How many a pod gets.
        memory: That a pod gets, as Kubernetes writes it; None for no limit.
        gpus: How many a pod gets.
        gpu_resource: What the cluster calls one.

    Raises:
        OptionError: A name or number cannot be used.
    """

    image: str
    claim: str
    mount: PurePosixPath
    name: str
    python: str
    cpus: float
    memory: str | None
    gpus: int
    gpu_resource: str

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise OptionError(
                f"--name={self.name}, but a Job's name has at most 50 small letters, digits and hyphens, "
                "begins with a letter and ends with a letter or digit."
            )
        if self.cpus <= 0 or self.gpus < 0:
            raise OptionError(
                f"--cpus={self.cpus} --gpus={self.gpus}, but there are no such numbers of them."
            )
        if not self.mount.is_absolute():
            raise OptionError(f"--mount={self.mount}, but must be an absolute path.")

    def folder(self, output: str) -> str:
        """The absolute path of the output folder in a pod.

        Raises:
            OptionError: It is not on the shared volume, or has several lines.
        """
        require_lines(output, str(self.mount))
        path = self.mount / output
        if not path.is_relative_to(self.mount) or ".." in path.parts:
            raise OptionError(
                f"--output={output} is outside of --mount={self.mount}, the volume that all pods share."
            )
        return str(path)

    def template(self, script: str, resources: Json) -> Json:
        """The template of pods that run a script for bash."""
        container = {
            "name": "libero-max",
            "image": self.image,
            # Kubernetes reads $(NAME) in a command as a variable of its own, and $$ as $.
            "command": ["bash", "-c", script.replace("$", "$$")],
            "resources": resources,
            "volumeMounts": [{"name": "shared", "mountPath": str(self.mount)}],
        }
        return {
            "spec": {
                "restartPolicy": "Never",
                "automountServiceAccountToken": False,
                "containers": [container],
                "volumes": [{"name": "shared", "persistentVolumeClaim": {"claimName": self.claim}}],
            }
        }

    def resources(self) -> Json:
        """What a pod that plays asks for. Processor time that nobody else wants is not refused."""
        memory = {} if self.memory is None else {"memory": self.memory}
        gpus = {self.gpu_resource: str(self.gpus)} if self.gpus else {}
        limits = {**memory, **gpus}
        return {"requests": {"cpu": f"{self.cpus:g}", **limits}, **({"limits": limits} if limits else {})}


def add_command(schedulers: Commands) -> None:
    """Add ``launch kubernetes`` to the parser."""
    kubernetes = schedulers.add_parser(
        "kubernetes",
        help="Shards as an Indexed Job of Kubernetes; the one that ends last merges them",
        description="For example: libero-max launch kubernetes --shards 64 --workers 8 --image "
        "registry.example.org/libero-max:1 --claim results --memory 32Gi -- --libero-max-policy=adapter.py "
        "--libero-max-track=max. Prints JSON for kubectl apply -f -. A shard whose pod fails, or could not "
        "measure a pair, is begun again up to 5 times, and goes on where it was; a pod that Kubernetes takes "
        "away is not counted. The shard that ends last merges all. Where a shard has failed for good, a "
        "second Job merges the others: it is suspended until you start it with kubectl patch job "
        'libero-max-merge -p \'{"spec":{"suspend":false}}\'. To play what is missing, kubectl delete job '
        "libero-max libero-max-merge and submit them again. Needs Kubernetes 1.29.",
    )
    add_arguments(kubernetes, "On the volume that all pods share; relative to --mount")
    kubernetes.add_argument(
        "--image",
        required=True,
        metavar="IMAGE",
        help="Of the container: has bash, pytest-libero-max and what the policy needs",
    )
    kubernetes.add_argument(
        "--claim",
        required=True,
        metavar="NAME",
        help="The PersistentVolumeClaim of the volume that all pods share: ReadWriteMany where they are on "
        "several nodes",
    )
    kubernetes.add_argument(
        "--mount",
        type=PurePosixPath,
        default=PurePosixPath("/work"),
        metavar="FOLDER",
        help="Where the volume is in a pod, which begins there (default: %(default)s)",
    )
    kubernetes.add_argument(
        "--name",
        default="libero-max",
        metavar="NAME",
        help="Of the Job; that of the second one ends with -merge (default: %(default)s)",
    )
    kubernetes.add_argument(
        "--python",
        default="python",
        metavar="PATH",
        help="The interpreter in the image (default: %(default)s)",
    )
    kubernetes.add_argument(
        "--cpus", type=float, metavar="N", help="That a pod asks for (default: as many as --workers)"
    )
    kubernetes.add_argument(
        "--memory",
        metavar="QUANTITY",
        help="That a pod asks for and may use, for example 32Gi (default: no limit)",
    )
    kubernetes.add_argument(
        "--gpus", type=int, default=0, metavar="N", help="That a pod gets (default: %(default)s)"
    )
    kubernetes.add_argument(
        "--gpu-resource",
        default="nvidia.com/gpu",
        metavar="NAME",
        help="What the cluster calls a GPU (default: %(default)s)",
    )
    kubernetes.set_defaults(run=_launch)


def _launch(options: argparse.Namespace) -> int:
    pods = Pods(
        image=options.image,
        claim=options.claim,
        mount=options.mount,
        name=options.name,
        python=options.python,
        cpus=options.workers if options.cpus is None else options.cpus,
        memory=options.memory,
        gpus=options.gpus,
        gpu_resource=options.gpu_resource,
    )
    jobs = json.dumps(kubernetes_jobs(Shards.of(options), pods, options.output), indent=2)
    if options.submit:
        return hand_over(jobs, ["kubectl", "apply", "-f", "-"])
    print(jobs)
    return 0


def kubernetes_jobs(shards: Shards, pods: Pods, output: str) -> Json:
    """A List of two Jobs: one that plays the shards, and a suspended one that merges what has ended.

    Args:
        shards: What is to be played.
        pods: Where.
        output: Where the runs go; relative to the shared volume.

    Raises:
        OptionError: The output is not on the shared volume.
    """
    folder = pods.folder(output)
    words = {"beginning": shards.beginning(str(pods.mount)), "incomplete": INCOMPLETE}
    play = _SHARD.format(
        shards=shards.count,
        pytest=shards.pytest(pods.python, folder, "$((JOB_COMPLETION_INDEX + 1))"),
        merge=shards.merge(pods.python, folder),
        gate_failed=GATE_FAILED,
        **words,
    )
    merge = _MERGE.format(merge=shards.merge(pods.python, folder, "--finished"), **words)
    play_spec = {
        "completionMode": "Indexed",
        "completions": shards.count,
        "parallelism": min(shards.at_once or shards.count, shards.count),
        "backoffLimitPerIndex": _RETRIES,
        "podFailurePolicy": {
            "rules": [
                {"action": "Ignore", "onPodConditions": [{"type": "DisruptionTarget", "status": "True"}]}
            ]
        },
        "template": pods.template(play, pods.resources()),
    }
    merge_spec = {
        "suspend": True,
        "backoffLimit": 0,
        "template": pods.template(merge, {"requests": {"cpu": "1"}}),
    }
    return {
        "apiVersion": "v1",
        "kind": "List",
        "items": [_job(pods.name, play_spec), _job(f"{pods.name}-merge", merge_spec)],
    }


def _job(name: str, spec: Json) -> Json:
    return {"apiVersion": "batch/v1", "kind": "Job", "metadata": {"name": name}, "spec": spec}
