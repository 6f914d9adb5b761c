"""Shadows at their limits: plants of all sizes anywhere, next to none, and suns that graze."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import cos, pi, radians, sin, tan

import numpy as np

from vegtool.arrays import FloatArray, unit
from vegtool.gl.sun import SunMaps
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import SUN_DEG, Sun
from vegtool.lighting.shadow import SunDepths, sun_visible
from vegtool.plant import Plant
from vegtool.seeding import generator
from vegtool.stability.cameras import plate
from vegtool.stability.case import Case, Outcome, drawn, exact, holds
from vegtool.stability.clustering import DEGENERATE
from vegtool.stability.plants import FAR, MOTIONS, SLOPE, Motion, facing, soup, tree


def depths_of(plant: Plant, toward: FloatArray, **how: int) -> SunDepths:
    """What the sun sees of a plant."""
    with PlantBuffers(plant) as buffers, SunMaps([buffers], toward, **how) as maps:
        return maps.read()


PLACES: tuple[tuple[str, float, FloatArray], ...] = tuple(
    (f"{scale:g} m large{said}", scale, middle)
    for scale in (1e-6, 1.0, 1e6)
    for said, middle in (("", np.zeros(3)), (", 5,000 km away", FAR))
)
"""Squares of all sizes anywhere: name, half a side in metres, middle."""


def under_a_square(scale: float, middle: FloatArray, sun: Sun) -> Outcome:
    """Places behind an opaque square, seen from the sun, are dark, those beside it lit: on the
    line of its middle and near its edges, close behind it and far."""
    toward = sun.direction
    normal = unit((toward + 0.3 * np.array([0.2, 0.5, -0.4]))[None])[0]  # not quite facing it
    frame = facing(normal)
    maps = depths_of(soup(middle + scale * (plate(1.0) @ frame)), toward)
    inside = np.array([[0.0, 0, 0], [0.9, 0.9, 0], [-0.9, 0.5, 0]])
    outside = np.array([[1.1, 0.0, 0], [-1.1, 1.1, 0], [0, -8.0, 0]])
    worst = 0.0
    for behind in (0.2, 1.0, 5.0):
        for places, right in ((inside, 0.0), (outside, 1.0)):
            at_m = middle + scale * (places @ frame - behind * toward)
            seen = sun_visible(at_m, np.tile(normal, (3, 1)), maps)
            worst = max(worst, float(np.abs(seen - right).max()))
    return exact(worst)


def few_shadows(made: Callable[[], FloatArray]) -> Outcome:
    """Maps of plants that are next to nothing, from the zenith, the horizon and their own plane:
    shares are from 0 to 1, and places between plant and sun are lit."""
    plant, wrong = soup(made()), 0
    size = plant.radius or 1.0
    for toward in (*np.eye(3), -np.eye(3)[1], unit(np.ones((1, 3)))[0]):
        maps = depths_of(plant, toward, side=128)
        side = unit(plant.face_area_vectors[:50] / size**2)
        behind = plant.face_centroids[:50] - 0.1 * size * toward
        seen = sun_visible(behind, side, maps)
        wrong += int((~(np.isfinite(seen) & (seen >= 0) & (seen <= 1 + 1e-12))).sum())
        clear = plant.center + 2.5 * size * toward
        wrong += int(abs(sun_visible(clear[None], side[:1], maps)[0] - 1) > 1e-12)
        wrong += int((~np.isfinite(maps.depth)).sum())
    return holds(wrong, "shares from 0 to 1")


SHADOWING: dict[str, Callable[[], FloatArray]] = {
    **{name: DEGENERATE[name][0] for name in (
        "a needle of aspect 1e6", "collinear, without area", "all points equal", "two points",
        "one triangle", "one leaf 1e4 times larger",
    )},
    "a level square": lambda: plate(1.0)[..., [0, 2, 1]],
    "an upright square": lambda: plate(1.0),
    "a square on a slope": lambda: plate(1.0) @ SLOPE,
}  # fmt: skip


def own_shadow(elevation: float) -> Outcome:
    """A leaf does not shadow itself, the sun standing so high above its surface: on slopes of all
    directions, of all sizes, anywhere."""
    random = generator(0, "stability", "slopes")
    worst = 0.0
    for _ in range(4):
        frame = facing(unit(random.normal(size=(1, 3)))[0], float(random.uniform(0, 2 * pi)))
        up, along = radians(elevation), random.uniform(0, 2 * pi)
        toward = np.array([cos(up) * cos(along), cos(up) * sin(along), sin(up)]) @ frame
        flat = np.concatenate([random.uniform(-0.99, 0.99, (300, 2)), np.zeros((300, 1))], axis=1)
        for _, scale, middle in PLACES:
            if elevation < 5 and np.linalg.norm(middle) > 1e12 * scale:
                continue  # its corners are known to a thousandth of it: no plane any more
            maps = depths_of(soup(middle + scale * (plate(1.0) @ frame)), toward)
            places, sides = middle + scale * (flat @ frame), np.tile(frame[2], (300, 1))
            worst = max(worst, 1 - float(sun_visible(places, sides, maps).min()))
    note = "half of the sun's disc is 0.265 degrees; lower, the leaf hides part of it"
    return Outcome(worst, 1e-9, "the exact answer", note=note if elevation < 1 else "")


def segment(offset: FloatArray) -> FloatArray:
    """Share of a disc of radius 1 on the near side of a straight edge, -1 to 1 from its middle."""
    inside = np.clip(offset, -1, 1)
    return np.asarray(0.5 + (inside * np.sqrt(1 - inside**2) + np.arcsin(inside)) / pi)


def penumbra(suns: int, distance: float, allowed: float) -> Outcome:
    """Across the edge of a shadow, from edges of all directions: the area of the sun's disc that is
    seen. `distance`: metres behind a square of 2 m."""
    worst = 0.0
    radius = distance * tan(radians(SUN_DEG / 2))
    offset = np.linspace(-1.3, 1.3, 201)
    for turn in np.arange(8) * pi / 8:
        frame = facing(np.array([0.0, 1.0, 0.0]), float(turn))
        maps = depths_of(soup(plate(1.0) @ frame), frame[2], suns=suns)
        flat = np.stack([1 + offset * radius, 0 * offset, 0 * offset - distance], axis=1)
        seen = sun_visible(flat @ frame, np.tile(frame[2], (201, 1)), maps)
        worst = max(worst, float(np.abs(seen - segment(offset)).max()))
    reason = f"{suns} points for a disc, and a texel of {maps.texel_m / radius:.2f} of its radius"
    return Outcome(worst, allowed, reason)


def maps_stay(motion: Motion) -> Outcome:
    """Moved and scaled, the sun sees the same tree: the mean difference of depths."""
    toward = Sun(60.0, 40.0).direction
    here, there = (depths_of(p, toward, side=256).depth for p in (tree(), motion.plant(tree())))
    apart = np.abs(here.astype(np.float64) - there)
    return drawn(float(apart.mean()), note=f"{(apart > 0).mean():.1e} of all texels differ")


CASES = (
    *(
        Case(f"shadow of a square {name}, sun at {sun.elevation_deg:g} degrees", "light", "exact",
             partial(under_a_square, scale, middle, sun), gl=True)
        for name, scale, middle in PLACES
        for sun in (Sun(0, 90), Sun(70, 40), Sun(200, 0))
    ),
    *(
        Case(f"shadow: {name}", "light", "property", partial(few_shadows, made), gl=True)
        for name, made in SHADOWING.items()
    ),
    *(
        Case(f"own shadow, sun {elevation:g} degrees above the leaf", "light", "exact",
             partial(own_shadow, elevation), gl=True)
        for elevation in (0.3, 1.0, 5.0, 30.0, 90.0)
    ),
    *(
        Case(f"penumbra, {suns} points of the sun, {distance:g} m", "light", "property",
             partial(penumbra, suns, distance, allowed), gl=True)
        for suns, distance, allowed in (
            (8, 5.0, 0.21), (8, 20.0, 0.21), (8, 80.0, 0.21), (64, 20.0, 0.05),
        )
    ),
    *(
        Case(f"what the sun sees of a tree, {motion.name}", "light", "equivariance",
             partial(maps_stay, motion), gl=True)
        for motion in MOTIONS
        if not motion.turns  # other texels would be drawn
    ),
)  # fmt: skip
