"""Plays the pairs of a session on a Ray cluster.

`--libero-max-ray` plays the pairs of a session on a Ray cluster, for example `pytest
--libero-max-policy=adapter.py --libero-max-track=max --libero-max-ray=auto,gpus=0.25`. It
needs the extra: `pip install -e '.[ray]'` in the clone, here and on the nodes, with the same Ray and
Python; the address of a client, `ray://HOST:PORT`, also needs `ray[client]`.

The session collects, stores, reports and decides as it does with `pytest -n`, and the records are the same.
Only the pairs go to the cluster, each to an actor that has a pytest session, a policy and worlds of its
own. Tests that are no pairs are played here afterwards. Ray places the actors where there is room for the
CPUs and GPUs that each takes, and a new one where an actor, its process or its node is lost. The pair that
was lost is played again, at most `--libero-max-retries` times; if each process that plays it dies, it is an
error with their crash log. Without `actors=N`, the number of actors follows the nodes that
join and leave. If no node is left, the run waits for one. If the head of the cluster is lost, Ray ends the
session after a minute, and `--libero-max-resume` continues it.

The nodes need what this machine has: the same pytest-libero-max, adapter and cases, at the same paths.
Either they share the folder in which pytest is called, or `--libero-max-ray=ADDRESS,ship` sends it to them,
without the output folder, `.git` and `.venv`; then name adapter and manifest relative to it. An actor says
what it has before it plays: if code, adapter or cases differ, the run stops and says which. Variables of the
environment are those of the node, apart from `MUJOCO_GL`, `PYOPENGL_PLATFORM`, `OPENBLAS_CORETYPE`,
`OPENBLAS_NUM_THREADS`, `PYTHONPATH`, `PYTEST_ADDOPTS`, `PYTEST_PLUGINS` and `LIBERO_MAX_SERVER_TOKEN`.
Traces and films are written by the actors: keep the output folder on a disk that all nodes share. With `-n`,
`--pdb` or `--cov` the session is refused.

All that this package hands to Ray or takes from it is text, read as JSON. Ray itself exchanges pickles
between its own processes, and whoever reaches its ports can run code on it: keep the cluster in a network
that you trust.
"""
