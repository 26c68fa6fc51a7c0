"""Scripted policies that ship with the package.

``expert`` and ``stale_expert`` solve the tasks by reading the simulator; ``noop`` and ``random`` do nothing
that solves a task. Each is loaded by its name (``--libero-max-policy=expert``). They serve two purposes:

* as a policy whose results are known, to try the benchmark and to compare an adapter with: ``expert`` plans
  anew at every query and so answers to an event, ``stale_expert`` has the same skill and never looks again;
* as the instrument of certificates: while tracks are built, a case is certified where ``expert`` completes
  its task after the event. Whether a case exists does not depend on it.

The two experts read MuJoCo's model and data, and the goal and the handles that a
:class:`~pytest_libero_max.worlds.privileged.ExpertWorld` offers. They never write to the world, never
look at images, never learn which event will happen or when, draw no random numbers, and keep nothing between
episodes: the same state of the world gives the same actions, bit for bit.
"""
