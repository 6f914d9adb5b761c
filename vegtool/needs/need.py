"""What the viewers of a scene see of each species: how near, how far, from which sides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from math import inf, pi
from typing import Literal

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import UsageError
from vegtool.lighting.light import Sun
from vegtool.lod import Display
from vegtool.needs.arcs import PARTS, covered, smallest
from vegtool.needs.planar import BoolArray
from vegtool.needs.viewers import Viewers, display_of, viewers_of
from vegtool.progress import Progress, silent
from vegtool.scene import Scene
from vegtool.tiles.library import Species
from vegtool.tiles.placement import Placement
from vegtool.tiles.stand import stand_on
from vegtool.tiles.terrain import Terrain

Lit = Literal["moving", "fixed", "unsaid"]
FEW = 32
"""Plants that are looked at one by one; of more, it is asked first whether they add anything."""


@dataclass(frozen=True)
class Need:
    """What can be seen of a species; of none of its plants where `plants` is 0.

    nearest, farthest: metres from its middle, on its axis half way up, divided by the plant's
    scale, as levels are chosen by; farthest may be infinite.
    azimuth: start and extent, radians, where eyes are as seen from the middle, in the model's own
    frame: from +z towards +x, less the plant's turn. elevation: low and high, radians above the
    horizon, likewise. What is beside the middle is seen from directions that differ by up to the
    arc sine of its distance from it, divided by `nearest`.
    above, below: whether an eye may be higher than a foot, and lower than a top: some of the plant
    is seen from above, or below.
    largest_px: pixels of its longest side, at `nearest`; infinite where an eye may be at its
    middle. display: whose pixels. lit, sun: how the scene is lit. plants: how many there are.
    """

    name: str
    nearest: float
    farthest: float
    azimuth: tuple[float, float]
    elevation: tuple[float, float]
    above: bool
    below: bool
    largest_px: float
    display: Display
    lit: Lit
    sun: Sun | None
    plants: int


@dataclass(eq=False)
class _Known:
    """What was found of a species so far."""

    nearest: float = inf
    farthest: float = 0.0
    low: float = pi / 2
    high: float = -pi / 2
    sides: BoolArray = field(default_factory=lambda: np.zeros(PARTS, np.bool_))
    above: bool = False
    below: bool = False
    plants: int = 0


@dataclass(frozen=True, eq=False)
class _Plants:
    """n of a species. middle: (n, 3) metres. radius: (n,) metres, of the ball that each fills.
    scale, yaw: (n,). foot, top: (n,) metres, heights in the scene's frame."""

    middle: FloatArray
    radius: FloatArray
    scale: FloatArray
    yaw: FloatArray
    foot: FloatArray
    top: FloatArray

    def __len__(self) -> int:
        return len(self.middle)

    def halves(self) -> list[_Plants]:
        """Those before and those after the one in the middle, along the longer side."""
        axis = int(np.ptp(self.middle, axis=0).argmax())
        order, half = np.argsort(self.middle[:, axis], kind="stable"), len(self) // 2
        return [
            _Plants(*(getattr(self, item.name)[part] for item in fields(self)))
            for part in (order[:half], order[half:])
        ]


def needs_of(
    scene: Scene,
    species: Sequence[Species],
    placement: Placement,
    ground: Terrain,
    progress: Progress = silent,
) -> tuple[Need, ...]:
    """What each of a scene's species is seen like, tile by tile of its placement.

    Raises UsageError, with file and line, where [camera] contradicts itself, the ground or the
    plants, as `viewers_of`.
    """
    viewers = viewers_of(scene, ground, placement)
    _check_seen_from_above(scene, viewers, species, placement)
    known = [_Known() for _ in species]
    count = len(placement.tiles)
    for tile in range(count):
        progress("needs", tile / count)
        stand = stand_on(placement, np.array([tile]), species)
        for kind in np.unique(stand.species):
            on = stand.species == kind
            one, scale, foot = species[kind], stand.scale[on], stand.foot[on]
            center, radius = ball_of(one)
            middle = foot + scale[:, None] * np.array([0.0, center, 0.0])
            top = foot[:, 1] + scale * one.height
            plants = _Plants(middle, scale * radius, scale, stand.yaw[on], foot[:, 1], top)
            _look(known[kind], viewers, plants, scene.camera.above is False)
    progress("needs", 1.0)
    display, lit = display_of(scene, viewers), _lit(scene)
    sun = None if scene.light is None else scene.light.sun
    return tuple(
        _need(one, found, display, lit, sun) for one, found in zip(species, known, strict=True)
    )


def ball_of(species: Species) -> tuple[float, float]:
    """Metres, at scale 1: how high above its foot the middle of a plant is, and the radius of the
    ball about it that holds all of the original."""
    low, high = species.bounds[0]
    side = np.abs(np.stack([low, high])).max(axis=0)
    half = float(high[1] - low[1]) / 2
    return float(low[1] + high[1]) / 2, float(np.hypot(np.hypot(side[0], side[2]), half))


def _look(known: _Known, viewers: Viewers, plants: _Plants, capped: bool) -> None:
    """Add plants to what is known. capped: whether eyes above their tops do not count.

    Groups of them that cannot add anything are passed over; others are halved, until few are left.
    """
    known.plants += len(plants)
    known.above |= bool(viewers.cells.high.max() > plants.foot.min())
    known.below |= bool(viewers.cells.low.min() < plants.top.max())
    if not known.sides.all():
        start, extent = viewers.azimuths(plants.middle, plants.radius)
        known.sides |= covered(start - plants.yaw, extent)
    left = [plants]
    while left:
        part = left.pop()
        wanted = _wanted(known, viewers, part)
        if any(wanted) and len(part) > FEW:
            left += part.halves()
        elif any(wanted):
            _add(known, viewers, part, capped, wanted)


def _wanted(known: _Known, viewers: Viewers, plants: _Plants) -> tuple[bool, bool, bool]:
    """Whether plants may be nearer, farther, or seen from another elevation than is known: by what
    holds for the middle of them all, and how far they are from it."""
    low, high = plants.middle.min(axis=0), plants.middle.max(axis=0)
    middle, spread = (low + high)[None] / 2, float(np.linalg.norm(high - low)) / 2
    near, far = float(viewers.nearest(middle)[0]), float(viewers.farthest(middle)[0])
    least, most = viewers.elevations(middle)
    apart = float(np.arcsin(min(spread / near, 1.0))) if near > 0 else pi
    around = near - spread <= plants.radius.max() or apart >= pi / 2
    lowest, highest = -pi / 2, pi / 2
    if not around:
        lowest, highest = float(least[0]) - apart, float(most[0]) + apart
    return (
        (near - spread) / plants.scale.max() < known.nearest and known.nearest > 0,
        (far + spread) / plants.scale.min() > known.farthest,
        max(lowest, -pi / 2) < known.low or min(highest, pi / 2) > known.high,
    )


def _add(
    known: _Known,
    viewers: Viewers,
    plants: _Plants,
    capped: bool,
    wanted: tuple[bool, bool, bool],
) -> None:
    nearer, farther, elsewhere = wanted
    if nearer:
        near = viewers.nearest(plants.middle) / plants.scale
        known.nearest = min(known.nearest, float(near.min()))
    if farther:
        far = viewers.farthest(plants.middle) / plants.scale
        known.farthest = max(known.farthest, float(far.max()))
    if elsewhere:
        ceiling = plants.top if capped else None
        low, high = viewers.elevations(plants.middle, plants.radius, ceiling)
        known.low, known.high = min(known.low, float(low.min())), max(known.high, float(high.max()))


def _need(one: Species, found: _Known, display: Display, lit: Lit, sun: Sun | None) -> Need:
    low, high = one.bounds[0]
    size_px = float((high - low).max()) * display.pixels_per_metre(1.0)
    if not found.plants:
        none = (0.0, 0.0)
        return Need(one.name, inf, 0.0, none, none, False, False, 0.0, display, lit, sun, 0)
    return Need(
        one.name, found.nearest, found.farthest, smallest(found.sides), (found.low, found.high),
        found.above, found.below, size_px / found.nearest if found.nearest > 0 else inf, display,
        lit, sun, found.plants,
    )  # fmt: skip


def _lit(scene: Scene) -> Lit:
    if scene.light is None:
        return "unsaid"
    return "moving" if scene.light.moves else "fixed"


def _check_seen_from_above(
    scene: Scene, viewers: Viewers, species: Sequence[Species], placement: Placement
) -> None:
    """Raise UsageError where the scene says that plants are seen from above and no eye is higher
    than any foot, or that they are not and an eye is higher above the ground than all are tall."""
    above, tiles = scene.camera.above, placement.tiles
    if above is None or not len(tiles):
        return
    at = f"{scene.at('camera', 'above')}: above"
    highest, lowest = float(viewers.cells.high.max()), float(tiles.low[:, 1].min())
    if above and highest <= lowest:
        raise UsageError(
            f"{at} is true, and no eye is higher than {highest:.4g} m, where the lowest plant "
            f"stands at {lowest:.4g} m; leave it out, or raise the eyes"
        )
    own = np.array([one.height for one in species])
    tall = placement.tallest(len(own))
    tall = np.where(placement.measured(len(own)) & np.isfinite(tall), tall, np.fmax(tall, own))
    if not above and np.isfinite(viewers.above_m) and viewers.above_m > tall.max():
        raise UsageError(
            f"{at} is false, and eyes are up to {viewers.above_m:.4g} m above the ground, where no "
            f"plant is taller than {tall.max():.4g} m; leave it out, or lower the eyes"
        )
