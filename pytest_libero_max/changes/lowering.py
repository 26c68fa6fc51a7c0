"""Lower an object onto another one: from above, down to the height at which the two would touch."""

from __future__ import annotations

from pytest_libero_max.errors import ChangeError
from pytest_libero_max.worlds.contract import AlterableWorld, Array

_STEP_M, _BISECTIONS, _MAX_STEPS = 0.004, 12, 500


def lower(world: AlterableWorld, name: str, onto: str, start: Array) -> None:
    """Lower an object until it would touch ``onto``, and leave it a few micrometres above that height."""
    at = start.copy()

    def meets(height: float) -> bool:
        at[2] = height
        world.place(name, at)
        return onto in world.contacts(name)

    free = float(start[2])
    for _ in range(_MAX_STEPS):
        if meets(free - _STEP_M):
            break
        free -= _STEP_M
    else:
        raise ChangeError(
            f"put_object: {name!r} does not meet {onto!r} at ({start[0]:.3f}, {start[1]:.3f}). "
            "Choose a place above it."
        )
    blocked = free - _STEP_M
    for _ in range(_BISECTIONS):
        middle = (free + blocked) / 2
        free, blocked = (free, middle) if meets(middle) else (middle, blocked)
    meets(free)  # the last height that was tried may be one at which they touch
