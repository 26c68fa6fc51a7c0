"""Objects without a part in any task, which insertions bring in: only their scenes are compiled with them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

_MASS_KG = 0.1
_FRICTION = (1.0, 0.1, 0.002)


@dataclass(frozen=True)
class Spare:
    """A small solid that stands at the near edge of the table until the setup of a case takes it out."""

    name: str
    shape: str
    """``box`` or ``cylinder``."""
    size_m: tuple[float, ...]
    """Half sides of a box; radius and half height of a cylinder."""
    colour: tuple[float, float, float]
    x_m: float
    """Its place along the edge."""

    @property
    def body(self) -> str:
        """Name of its body in the model."""
        return f"{self.name}_main"

    @property
    def inertia_kg_m2(self) -> tuple[float, float, float]:
        """Moments of inertia about its axes, of a solid."""
        if self.shape == "box":
            x, y, z = (_MASS_KG * half**2 / 3.0 for half in self.size_m)
            return y + z, x + z, x + y
        radius, half = self.size_m
        across = _MASS_KG * (radius**2 / 4.0 + half**2 / 3.0)
        return across, across, _MASS_KG * radius**2 / 2.0


SPARES = (
    Spare("spare_1", "box", (0.02, 0.02, 0.035), (0.9, 0.55, 0.1), -0.62),
    Spare("spare_2", "cylinder", (0.022, 0.03), (0.15, 0.45, 0.85), -0.5),
    Spare("spare_3", "box", (0.03, 0.02, 0.02), (0.55, 0.2, 0.65), 0.38),
    Spare("spare_4", "cylinder", (0.03, 0.018), (0.2, 0.65, 0.35), 0.5),
    Spare("spare_5", "box", (0.022, 0.022, 0.022), (0.9, 0.9, 0.25), 0.62),
)
_EDGE_Y_M = 0.26


def add_to(spec: Any, names: Collection[str]) -> None:
    """Add spare objects to a model that is not compiled yet, behind everything else."""
    import mujoco

    for spare in SPARES:
        if spare.name not in names:
            continue
        body = spec.worldbody.add_body(
            name=spare.body,
            pos=(spare.x_m, _EDGE_Y_M, spare.size_m[-1]),
            explicitinertial=True,  # the scenes compute inertia from other geom groups alone
            mass=_MASS_KG,
            ipos=(0.0, 0.0, 0.0),  # it is the place of the body otherwise
            inertia=spare.inertia_kg_m2,
        )
        body.add_freejoint()
        body.add_geom(
            type=getattr(mujoco.mjtGeom, f"mjGEOM_{spare.shape.upper()}"),
            size=(*spare.size_m, *[0.0] * (3 - len(spare.size_m))),
            rgba=(*spare.colour, 1.0),
            friction=_FRICTION,
            condim=4,
            solref=(0.01, 1.0),
        )
