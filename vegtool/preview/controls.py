"""Two ways of moving an eye by hand: flying freely, and orbiting about a point.

Both are plain values that a window feeds with what was pressed since the last frame. They do not
depend on how the time is cut into frames.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import ceil, inf

import numpy as np

from vegtool.arrays import FloatArray, checked
from vegtool.camera_path.course import Ground
from vegtool.preview.eye import Eye

SPEED_M_S = 3.0
"""Of flight, until the wheel is turned: a fast walk."""
FASTER = 4.0
"""Times the speed while shift is held."""
SPEEDS_M_S = (0.1, 1000.0)
"""Least and greatest speed that the wheel gives."""
PER_CLICK = 1.2
"""What a click of the wheel multiplies by: the speed of flight, or what divides the distance."""
DEG_PER_PX = 0.2
"""How far a mouse turns the eye."""
CLEARANCE_M = 0.3
"""Least height of a flying eye above the ground."""
STRIDE_M = 0.5
"""Longest way between two looks at the ground; longer where there would be more than STRIDES."""
STRIDES = 64

_ALONG = {
    "right": ({"d", "right"}, {"a", "left"}),
    "up": ({"e"}, {"q"}),
    "back": ({"s", "down"}, {"w", "up"}),
}
"""Direction -> keys that move along it, and against it."""


@dataclass(frozen=True)
class Input:
    """What was done since the last frame.

    held: names of keys that are down, in small letters: "w", "a", "s", "d", "q", "e", "left",
    "right", "up", "down", "shift"; others are of no effect. drag_px: how far the mouse moved with
    its button down, right and down. scroll: clicks of the wheel, positive away from the hand.
    """

    held: frozenset[str] = frozenset()
    drag_px: tuple[float, float] = (0.0, 0.0)
    scroll: float = 0.0


@dataclass(frozen=True, eq=False)
class Fly:
    """An eye that goes where it looks. speed_m_s: without shift. clearance_m: the eye stays at
    least that high above `ground`, where there is one."""

    eye: Eye
    speed_m_s: float = SPEED_M_S
    ground: Ground | None = None
    clearance_m: float = CLEARANCE_M


@dataclass(frozen=True, eq=False)
class Orbit:
    """An eye that turns about a point, which stays where it is in the picture.

    target: (3,) metres. offset: (3,) metres, from the eye to the target along the eye's axes
    right, up and back; (0, 0, -5) has the target 5 m ahead, in the middle of the picture.
    limits_m: least and greatest distance that the wheel gives.
    lens: yaw, pitch, field of view and planes of the eye; its position is of no meaning.
    """

    target: FloatArray
    offset: FloatArray
    lens: Eye = field(default_factory=lambda: Eye(np.zeros(3)))
    limits_m: tuple[float, float] = (0.5, 1000.0)

    def __post_init__(self) -> None:
        for name in ("target", "offset"):
            value = checked(f"Orbit.{name}", getattr(self, name), (3,), np.float64)
            object.__setattr__(self, name, value)

    @property
    def distance_m(self) -> float:
        """From the eye to the target."""
        return float(np.linalg.norm(self.offset))

    @property
    def eye(self) -> Eye:
        """The eye where it is."""
        return replace(self.lens, position=self.target - self.offset @ self.lens.axes)


def fly(state: Fly, given: Input, seconds: float) -> Fly:
    """Look around, then move for so many seconds.

    W, S, A, D and arrow keys move forward, back, left and right of where the eye looks, Q and E
    down and up, shift FASTER; two keys move no faster than one. The wheel changes the speed.
    Raises ValueError for a time that is negative, infinite or no number.
    """
    _check_seconds(seconds)
    eye = _turned(state.eye, given)
    speed = _limited(state.speed_m_s * _clicks(given.scroll), SPEEDS_M_S)
    faster = FASTER if "shift" in given.held else 1.0
    way = _direction(eye, given.held) * (speed * faster * seconds)
    position = _moved(eye.position, way, state.ground, state.clearance_m)
    return replace(state, eye=replace(eye, position=position), speed_m_s=speed)


def orbit(state: Orbit, given: Input, seconds: float = 0.0) -> Orbit:
    """Turn about the target by what the mouse was dragged, and come nearer or go farther by what
    the wheel was turned. No time passes: `seconds` is there for both ways to be called alike.

    Raises ValueError for a time that is negative, infinite or no number.
    """
    _check_seconds(seconds)
    distance = state.distance_m
    # an eye that was brought here from beyond the limits is not thrown back to them
    limits = min(state.limits_m[0], distance), max(state.limits_m[1], distance)
    wanted = _limited(distance / _clicks(given.scroll), limits)
    if distance > 0:
        offset = state.offset * (wanted / distance)
    else:
        offset = np.array([0.0, 0.0, -state.limits_m[0] if given.scroll < 0 else 0.0])
    return replace(state, offset=offset, lens=_turned(state.lens, given))


def orbiting(eye: Eye, target: FloatArray, limits_m: tuple[float, float] = (0.5, 1000.0)) -> Orbit:
    """An orbit about a target that begins with the picture that the eye sees now."""
    return Orbit(target, eye.axes @ (target - eye.position), eye, limits_m)


def flying(
    eye: Eye,
    speed_m_s: float = SPEED_M_S,
    ground: Ground | None = None,
    clearance_m: float = CLEARANCE_M,
) -> Fly:
    """A flight that begins with the picture that the eye sees now."""
    return Fly(eye, speed_m_s, ground, clearance_m)


def _moved(
    position: FloatArray, way: FloatArray, ground: Ground | None, clearance_m: float
) -> FloatArray:
    """A position after a way, over every hill on it: both (3,) metres."""
    if ground is None:
        return np.asarray(position + way)
    moved = np.array(position)
    strides = min(max(ceil(float(np.linalg.norm(way)) / STRIDE_M), 1), STRIDES)
    for _ in range(strides):
        moved += way / strides
        # beyond the ground's edge its height may be no number, which limits nothing
        moved[1] = max(moved[1], ground(float(moved[0]), float(moved[2])) + clearance_m)
    return moved


def _turned(eye: Eye, given: Input) -> Eye:
    """To the right and down where the mouse goes right and down, and never over the top."""
    right, down = (DEG_PER_PX * pixels for pixels in given.drag_px)
    pitch = _limited(eye.pitch_deg - down, (-90.0, 90.0))
    return replace(eye, yaw_deg=(eye.yaw_deg - right) % 360.0, pitch_deg=pitch)


def _direction(eye: Eye, held: frozenset[str]) -> FloatArray:
    """(3,) unit vector that the keys move along, or zeros; up is the world's."""
    right, _, back = eye.axes
    vectors = {"right": right, "up": np.array([0.0, 1.0, 0.0]), "back": back}
    total = np.zeros(3)
    for name, (along, against) in _ALONG.items():
        total += vectors[name] * (bool(held & along) - bool(held & against))
    length = float(np.linalg.norm(total))
    # looking straight up, W and Q cancel each other but for a rounding
    return total / length if length > 1e-9 else np.zeros(3)


def _clicks(scroll: float) -> float:
    """What so many clicks multiply by; a thousand are enough for any limits, and for a float."""
    return float(PER_CLICK ** _limited(scroll, (-1000.0, 1000.0)))


def _limited(value: float, limits: tuple[float, float]) -> float:
    return min(max(value, limits[0]), limits[1])


def _check_seconds(seconds: float) -> None:
    if not 0 <= seconds < inf:
        raise ValueError(f"expected seconds of at least 0; got {seconds}")
