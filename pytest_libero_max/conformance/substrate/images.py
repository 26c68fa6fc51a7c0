"""Rules for observations: keys, shapes, orientation, and images that stay the same in the same state."""

from __future__ import annotations

import numpy as np

from pytest_libero_max.conformance.rules import Finding, broken, kept, rule, unexamined
from pytest_libero_max.conformance.substrate.contract import OPENS
from pytest_libero_max.conformance.substrate.states import RESTORE
from pytest_libero_max.conformance.substrate.subject import SubstrateSubject, actions_for
from pytest_libero_max.errors import counted
from pytest_libero_max.worlds.contract import AlterableWorld, Array, alterable

KEYS = "substrate/images/keys"

_SIDE = 128
Points = list[tuple[float, float]]


@rule(KEYS, "must", needs=OPENS)
def keys(subject: SubstrateSubject) -> Finding:
    """Observe the keys of the robot, LIBERO's for its Panda, each in its shape."""
    world = subject.begin()
    robot = world.robot
    observation = world.observe(robot.cameras, (96, _SIDE))
    shapes: dict[str, tuple[int, ...]] = {key: (size,) for key, size in robot.state.items()}
    shapes |= {f"{camera}_image": (96, _SIDE, 3) for camera in robot.cameras}
    wrong = [
        f"{key} {observation[key].shape if key in observation else 'missing'}"
        for key, shape in shapes.items()
        if key not in observation or observation[key].shape != shape
    ]
    wrong += [
        f"{camera}_image of {observation[f'{camera}_image'].dtype}"
        for camera in robot.cameras
        if f"{camera}_image" in observation and observation[f"{camera}_image"].dtype != np.uint8
    ]
    if wrong:
        return broken(
            ", ".join(wrong),
            f"the keys and shapes of robot {robot.name!r}, images (H, W, 3) uint8",
            "Rename and reshape.",
        )
    return kept(f"{len(shapes)} keys in their shapes")


@rule("substrate/images/same", "must", needs=KEYS)
def same_images(subject: SubstrateSubject) -> Finding:
    """Draw the same pixels in the same state: twice, and after steps that restore() took back."""
    world = subject.begin()
    first = world.observe(world.robot.cameras, _SIDE)
    repeated = world.observe(world.robot.cameras, _SIDE)
    state = world.snapshot()
    for action in actions_for(world):
        world.step(action)
    moved = world.observe(world.robot.cameras, _SIDE)
    world.restore(state)
    after = world.observe(world.robot.cameras, _SIDE)
    for camera in world.robot.cameras:
        key = f"{camera}_image"
        for what, later in (("drawn twice", repeated), ("drawn after restore()", after)):
            if not np.array_equal(first[key], later[key]):
                return broken(
                    f"{key} {what} differs in {int((first[key] != later[key]).any(axis=2).sum())} pixels",
                    "the same pixels",
                    "Something that is drawn is not part of the state.",
                )
        if np.array_equal(first[key], moved[key]):
            return broken(
                f"{key} is the same after {counted(len(actions_for(world)), 'step')}",
                "another image",
                "An old image is returned, or what moves is not drawn: MuJoCo's geoms of groups 1 and 2 are.",
            )
    return kept("the same state has the same pixels, another one has others")


@rule("substrate/images/physics", "must", needs=KEYS)
def drawing_alters_nothing(subject: SubstrateSubject) -> Finding:
    """Leave the state as it is when images are drawn."""
    world = subject.begin()
    before = world.digest()
    world.observe(world.robot.cameras, _SIDE)
    if world.digest() == before:
        return kept("drawing alters nothing")
    return broken("the digest changed when images were drawn", "the same digest", "Draw from a copy.")


@rule("substrate/images/rows", "must", needs=RESTORE)
def row_order(subject: SubstrateSubject) -> Finding:
    """Deliver images bottom row first, not mirrored, as LIBERO does."""
    from pytest_libero_max.worlds.rendering.appearance import pose_of_camera

    world = subject.begin()
    if not isinstance(world, AlterableWorld):
        return unexamined("the pose of the camera is known of worlds that changes can alter alone")
    camera = world.robot.cameras[0]
    places, images = [], []
    for axis, sign in ((1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)):
        world = subject.begin()
        action = np.array(world.robot.noop)
        action[axis] = sign
        for _ in range(4):
            world.step(action)
        position, turn, fovy_rad = pose_of_camera(alterable(world), camera)
        x, y, z = (np.asarray(world.end_effector()) - position) @ turn
        focal = 0.5 * _SIDE / np.tan(0.5 * fovy_rad)
        place = (_SIDE / 2 - focal * y / z, _SIDE / 2 - focal * x / z)
        if z < 0.0 and min(place) > 0.0 and max(place) < _SIDE:
            places.append(place)
            images.append(world.observe([camera], _SIDE)[f"{camera}_image"].astype(float))
    if len(places) < 3:
        return unexamined("the hand leaves the view of the main camera within four steps")
    hands = [_what_only_this_shows(images, number) for number in range(len(images))]
    turns = {
        "bottom row first": (1, 1),
        "top row first": (-1, 1),
        "bottom row first and mirrored": (1, -1),
        "top row first and mirrored": (-1, -1),
    }
    likeness = {name: _likeness(hands, places, turn) for name, turn in turns.items()}
    best = max(likeness, key=lambda name: likeness[name])
    if best == "bottom row first":
        return kept("images come bottom row first, as OpenGL delivers them")
    return broken(
        f"images come {best}",
        "bottom row first, so that image[::-1] is upright",
        "Policies rotate images by 180 degrees: an image that is upright already arrives upside down.",
    )


def _what_only_this_shows(images: list[Array], number: int) -> tuple[float, float]:
    """Return the row and the column around which an image differs from each of the others: the hand."""
    others = [image for index, image in enumerate(images) if index != number]
    weights = np.min([np.abs(images[number] - image).sum(axis=2) for image in others], axis=0)
    rows, columns = np.indices(weights.shape)
    total = max(float(weights.sum()), 1e-9)
    return float((rows * weights).sum()) / total, float((columns * weights).sum()) / total


def _likeness(hands: Points, places: Points, turn: tuple[int, int]) -> float:
    """Return how well the movements of the hand from image to image fit those of its places, if turned."""
    seen, meant = (np.array(points) - np.mean(points, axis=0) for points in (hands, places))
    return float((seen * meant * turn).sum())
