"""Limits of the numbers of every report, as statements."""

from __future__ import annotations

from collections.abc import Mapping

LIMITS_TITLE = "What these numbers do not show"
"""Heading of the statements."""

STATEMENTS: Mapping[str, str] = {
    "interval": "An interval describes how precisely these cases measure this policy. It does not "
    "cover how much the policy would differ if it were trained again.",
    "generalisation": "The first interval of a paired change is for these tasks played again with "
    "other initial states and seeds. The interval by task is for other tasks of the same kind, and "
    "needs 30 tasks of which 15 have a changed pair.",
    "policies": "Policies differ in size, training data and serving at once. A difference between "
    "policies, or between families of policies, does not show which architecture or "
    "design is more robust.",
    "behaviour": "Success at the end of an episode and queries after the event are observable "
    "behaviour. They show sensitivity to the event, not whether the policy detected it or "
    "planned anew.",
    "simulation": "The benchmark covers simulated manipulation within LIBERO's visual, contact and task "
    "abstractions.",
    "one_event": "A case of the benchmark's tracks has one event, which lasts, and which comes before "
    "the grasp. Transfer to physical robots, to later stages of a task, and to repeated "
    "or reversible changes is not established.",
    "screening": "The cases of the tracks were screened by program for support, workspace, visibility "
    "and collisions. An audit of their feasibility by people is not complete.",
    "abrupt": "Some events are abrupt in the simulator. How natural they are, and whether they can "
    "be realised physically, needs an assessment of its own.",
    "studies": "The paper's control studies are narrow: three policies for the camera, one policy "
    "and one event for restored sensing.",
    "safety": "Safety is not measured. Completing a task does not imply a safe deployment.",
}
"""Sentences by a stable key. They hold for every run: a part of a track, any substrate, no played pair."""
