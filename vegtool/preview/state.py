"""What a viewer does and how: apart from windows, so that it can be set, kept and tested.

A key is one line of KEYS: what it is called, what it does, and the function from state to state.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.lighting.light import Light, Sun
from vegtool.preview.controls import Fly, Input, Orbit, fly, flying, orbit, orbiting
from vegtool.preview.eye import Eye
from vegtool.preview.governor import Governor
from vegtool.preview.palette import COLORS, Color
from vegtool.preview.size_control import LARGEST_PX, SMALLEST_PX, SizeControl

SUN_STEP_DEG = 5.0
DETAIL_STEP = 1.1
LEAST_DETAIL, MOST_DETAIL = 1 / 256, 4.0
FIRST_DETAIL = 1 / 48
"""Where frames are held at a time: what they take is found out from below, not from above."""


@dataclass(frozen=True, eq=False)
class State:
    """camera: what moves the eye. target: (3,) metres, what is orbited about. sun: None for the
    usual light. detail: factor of all distances, where no governor sets it. level: the level that
    is held, or None. governor: what holds the frame time, by distances or where there are surfels
    by their size, or None. stereo: two pictures side by side, for two eyes; compare: three others.
    flight: how the eye flew before it orbited.
    Raises ValueError where it is both.
    """

    camera: Fly | Orbit
    target: FloatArray = field(default_factory=lambda: np.zeros(3))
    sun: Sun | None = None
    detail: float = 1.0
    level: int | None = None
    color: Color = "as it is"
    wireframe: bool = False
    compare: bool = False
    stereo: bool = False
    told: bool = True
    help: bool = False
    recording: bool = False
    screenshots: int = 0
    closing: bool = False
    governor: Governor | SizeControl | None = None
    flight: Fly | None = None

    def __post_init__(self) -> None:
        if self.compare and self.stereo:
            raise ValueError("State: expected compare or stereo, each fills the window; got both")

    @property
    def eye(self) -> Eye:
        """Where it is now."""
        return self.camera.eye

    @property
    def light(self) -> Light:
        """Of the sun."""
        return Light() if self.sun is None else self.sun.light

    @property
    def distances(self) -> float:
        """The factor of all switch distances."""
        return self.detail if self.governor is None else self.governor.detail

    @property
    def surfel_px(self) -> float:
        """Diameter of surfels, as large as the distances ask for."""
        return min(max(1 / self.distances, SMALLEST_PX), LARGEST_PX)


@dataclass(frozen=True)
class Binding:
    """A key and what it does. name: as windows call it. shown: as people do."""

    name: str
    shown: str
    help: str
    act: Callable[[State], State]


def moved(state: State, given: Input, seconds: float) -> State:
    """The state after so many seconds of what is held."""
    camera = state.camera
    if isinstance(camera, Fly):
        return replace(state, camera=fly(camera, given, seconds))
    return replace(state, camera=orbit(camera, given, seconds))


def toggled(name: str) -> Callable[[State], State]:
    """What turns a field of the state on and off."""

    def act(state: State) -> State:
        values: dict[str, Any] = {name: not getattr(state, name)}
        return replace(state, **values)

    return act


def _other_camera(state: State) -> State:
    if isinstance(state.camera, Fly):
        return replace(state, camera=orbiting(state.eye, state.target), flight=state.camera)
    if state.flight is None:
        return replace(state, camera=flying(state.eye))
    return replace(state, camera=replace(state.flight, eye=state.eye))


def _sun_by(azimuth: float, elevation: float) -> Callable[[State], State]:
    def act(state: State) -> State:
        sun = state.sun or _sun_of(Light())
        high = float(np.clip(sun.elevation_deg + elevation, -90.0, 90.0))
        return replace(state, sun=Sun((sun.azimuth_deg + azimuth) % 360.0, high))

    return act


def _sun_of(light: Light) -> Sun:
    x, y, z = light.unit
    return Sun(float(np.degrees(np.arctan2(x, z))) % 360.0, float(np.degrees(np.arcsin(y))))


def _detail_by(factor: float) -> Callable[[State], State]:
    def act(state: State) -> State:
        detail = float(np.clip(state.distances * factor, LEAST_DETAIL, MOST_DETAIL))
        return replace(state, detail=detail, governor=None)

    return act


def _next_color(state: State) -> State:
    following = (COLORS.index(state.color) + 1) % len(COLORS)
    return replace(state, color=COLORS[following])


def _compare(state: State) -> State:
    return state if state.stereo else replace(state, compare=not state.compare)


def _hold(level: int | None) -> Callable[[State], State]:
    return lambda state: replace(state, level=level)


KEYS: tuple[Binding, ...] = (
    Binding("h", "h", "show and hide this help", toggled("help")),
    Binding("i", "i", "show and hide figures", toggled("told")),
    Binding("c", "c", "fly or orbit", _other_camera),
    Binding("v", "v", "colour as it is, by level, by species, by overdraw",
            _next_color),
    Binding("x", "x", "wireframe", toggled("wireframe")),
    Binding("m", "m", "compare with the plants in full, side by side", _compare),
    Binding("bracketleft", "[", "sun to the left", _sun_by(-SUN_STEP_DEG, 0.0)),
    Binding("bracketright", "]", "sun to the right", _sun_by(SUN_STEP_DEG, 0.0)),
    Binding("pageup", "Page Up", "sun higher", _sun_by(0.0, SUN_STEP_DEG)),
    Binding("pagedown", "Page Down", "sun lower", _sun_by(0.0, -SUN_STEP_DEG)),
    Binding("plus", "+", "levels last longer: more detail", _detail_by(DETAIL_STEP)),
    Binding("equal", "=", "the same", _detail_by(DETAIL_STEP)),
    Binding("minus", "-", "levels end sooner: less detail", _detail_by(1 / DETAIL_STEP)),
    *(Binding(str(n), str(n), f"hold level {n}", _hold(n)) for n in range(10)),
    Binding("l", "l", "levels by distance again", _hold(None)),
    Binding("p", "p", "save a picture",
            lambda s: replace(s, screenshots=s.screenshots + 1)),
    Binding("r", "r", "record the way, or end it", toggled("recording")),
    Binding("escape", "Esc", "close", lambda s: replace(s, closing=True)),
)  # fmt: skip
"""All keys but those that move, in the order in which the help shows them."""
_BY_NAME = {binding.name: binding for binding in KEYS}
UNSHOWN = {"equal", *(str(n) for n in range(1, 10))}
"""Keys that the help does not list one by one."""


def pressed(state: State, name: str) -> State:
    """The state after a key; keys that are not in the table change nothing."""
    binding = _BY_NAME.get(name)
    return state if binding is None else binding.act(state)


def help_text() -> str:
    """All keys, a line each."""
    lines = [
        ("w a s d, arrows", "move; q and e down and up; shift faster"),
        ("mouse", "look around; wheel: speed, or distance"),
        *(
            ("0 to 9" if b.name == "0" else b.shown, "hold a level" if b.name == "0" else b.help)
            for b in KEYS
            if b.name not in UNSHOWN
        ),
    ]
    width = max(len(key) for key, _ in lines)
    return "\n".join(f"{key.ljust(width)}  {what}" for key, what in lines)
