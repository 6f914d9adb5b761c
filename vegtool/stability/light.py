"""Light at its limits: suns that graze, shading without normals, the sky that any plant sees."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from fractions import Fraction
from functools import cache, partial
from itertools import pairwise
from math import cos, inf, radians, sin

import numpy as np

from vegtool.arrays import FloatArray, unit
from vegtool.gl.draw import draw
from vegtool.gl.sun import SunMaps
from vegtool.gl.surface import surface
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.crown import crown_normals
from vegtool.lighting.leaves import translucent
from vegtool.lighting.light import Light, Sun
from vegtool.lighting.shading import shaded, sky_light, turned_to
from vegtool.lighting.shadow import sun_visible
from vegtool.lod import Display
from vegtool.measure.pictures import shot_of
from vegtool.measure.views import around, direction
from vegtool.plant import Plant
from vegtool.refine.occlusion import exposed, exposures
from vegtool.seeding import generator
from vegtool.stability.cameras import UPRIGHT_MOTIONS, camera, plate
from vegtool.stability.case import Case, Outcome, exact, holds, same_objective
from vegtool.stability.clustering import DEGENERATE
from vegtool.stability.plants import MOTIONS, SLOPE, Motion, at, rotation, soup, tree

STEP = 1 / 255
"""Of a colour in eight bits: what arrays and the GPU may differ by."""
GRAZE = 1e-6
"""Radians off the plane of a billboard, either way."""
PIXELS = 100.0
"""Size of the tree in pictures."""


def normals(count: int = 200) -> FloatArray:
    """(count, 3) unit vectors of all directions, the axes among them."""
    random = generator(0, "stability", "normals")
    return np.concatenate([np.eye(3), -np.eye(3), unit(random.normal(size=(count - 6, 3)))])


def sun_stands(azimuth: float, elevation: float) -> Outcome:
    """Towards the sun: as high as the sine says, of length one, and as far round; its light is the
    sky's alone once it is below the horizon."""
    sun = Sun(azimuth, elevation)
    x, y, z = sun.direction.tolist()
    error = abs(y - sin(radians(elevation))) + abs(x * x + y * y + z * z - 1)
    error += abs(x * cos(radians(azimuth)) - z * sin(radians(azimuth)))
    white, normal = np.ones((200, 3)), normals()
    night = white * sky_light(normal, sun.light)[:, None]
    if elevation < 0:
        error += float(np.abs(shaded(white, normal, sun.light) - night).max())
    elif not (shaded(white, normal, sun.light) > night).any():
        error = inf
    return exact(error)


def any_length(length: float) -> Outcome:
    """A light's direction may be of any length: shading, and maps, are those of the unit vector."""
    toward = np.array([0.5, 1.0, -0.7])
    white, normal = np.ones((200, 3)), normals()
    here, there = (shaded(white, normal, Light(d)) for d in (toward, length * toward))
    with PlantBuffers(soup(plate(1.0))) as buffers:
        depths = []
        for sun in (toward, length * toward):
            with SunMaps([buffers], sun, side=64) as maps:
                depths.append(maps.read().depth.astype(np.float64))
    return exact(float(np.abs(here - there).max() + np.abs(depths[0] - depths[1]).max()))


def shading_in_fractions(transmission: float, exposure: float, tint: float) -> Outcome:
    """The model in rational numbers, normal by normal, the sun half hidden from either side."""
    light, color = Light(), np.array([0.1, 0.5, 0.9])
    error = 0.0
    found = shaded(np.tile(color, (200, 1)), normals(), light, np.full((200, 2), exposure),
                   transmission, (tint, 1.0, 1 / 3), 0.5, 0.25)  # fmt: skip
    toward = [Fraction(x) for x in light.unit.tolist()]
    sun, above, below = (Fraction(x) for x in (light.sun, light.sky_above, light.sky_below))
    share = Fraction(transmission)
    for normal, row in zip(normals().tolist(), found.tolist(), strict=True):
        n = [Fraction(x) for x in normal]
        faces = sum(a * b for a, b in zip(n, toward, strict=True))

        def sky(y: Fraction) -> Fraction:
            return Fraction(exposure) * (below + (above - below) * (1 + y) / 2)

        here = sun / 2 * max(faces, Fraction(0)) + sky(n[1])
        behind = sun / 4 * max(-faces, Fraction(0)) + sky(-n[1])
        for value, albedo, times in zip(row, color.tolist(), (tint, 1.0, 1 / 3), strict=True):
            right = Fraction(albedo) * ((1 - share) * here + share * behind * Fraction(times))
            error = max(error, abs(float(Fraction(value) - right)))
    return exact(error)


def energy(transmission: float) -> Outcome:
    """Of white surfaces, both sides together send what falls on both: no more, and no less."""
    light, normal, white = Light(), normals(), np.ones((200, 3))
    exposure = generator(0, "stability", "exposure").random((200, 2))
    front, back = (
        shaded(white, n, light, e, transmission, visible=0.5, through=0.5)
        for n, e in ((normal, exposure), (-normal, exposure[:, ::-1]))
    )
    falls = light.sun * 0.5 * np.abs(normal @ light.unit)
    falls += exposure[:, 0] * sky_light(normal, light) + exposure[:, 1] * sky_light(-normal, light)
    return exact(float(np.abs(front + back - falls[:, None]).max()))


def along_the_plane(transmission: float) -> Outcome:
    """The sun in a billboard's plane: what it shows is finite, and does not jump as it passes."""
    worst = 0.0
    for normal in normals():
        across = unit(np.cross(normal, np.eye(3)[np.abs(normal).argmin()])[None])[0]
        shown = []
        for side in (-GRAZE, 0.0, GRAZE):
            light = Light(cos(side) * across + sin(side) * normal)
            faces = np.stack([normal, turned_to(-normal[None], normal[None])[0]])
            shown.append(shaded(np.ones((2, 3)), faces, light, None, transmission))
        spread = np.ptp(np.array(shown), axis=(0, 1)).max()
        worst = max(worst, float(spread) if np.isfinite(shown).all() else inf)
    return Outcome(worst, 1e-5, f"the sun turns by {2 * GRAZE:.0e} radians")


def behind_a_leaf(transmission: float) -> Outcome:
    """The sun exactly behind: the leaf shows that share of it, and of the sky's light."""
    error = 0.0
    for normal in normals():
        light = Light(-normal)
        own, other = (sky_light(n, light) for n in (normal, -normal))
        right = (1 - transmission) * own + transmission * (light.sun + other)
        found = shaded(np.ones(3), normal, light, None, np.float64(transmission))
        error = max(error, float(np.abs(found - right).max()))
    return exact(error)


def without_normals() -> Outcome:
    """What has no normal is lit by the mean of the skies, whatever the sun."""
    light = Light()
    mean = (light.sky_above + light.sky_below) / 2
    found = shaded(np.ones((1, 3)), np.zeros((1, 3)), light, None, 0.25)
    return exact(float(np.abs(found - mean).max()))


def drawn_without_normals(made: FloatArray) -> Outcome:
    """Vertices whose normals are of no length, hardly any, or opposite: drawn, what is seen lies
    within what the sky and the sun may give, and is what the reference says."""
    plant = replace(soup(plate(1.0)), normals=np.tile(made, (2, 1)))
    light = Light(np.array([0.3, 0.4, 1.0]))
    with PlantBuffers(plant) as buffers:
        shot = shot_of(camera(30.0, 10.0, 3.0, direction(20.0, 10.0)))
        picture, seen = draw(buffers, shot, light), surface(buffers, shot)
    shown = picture[picture[..., 3] > 0][:, :3]
    most = light.sun + light.sky_above
    wrong = (~np.isfinite(picture)).sum() + (shown < light.sky_below - STEP).sum()
    wrong += (shown > most + STEP).sum() + (len(shown) == 0)
    albedo, normal = seen.color.astype(np.float64), seen.normal.astype(np.float64)
    expected = seen.picture(shaded(albedo, normal, light))
    wrong += (np.abs(picture - expected) > STEP).sum()
    note = f"light from {shown.min():.3f} to {shown.max():.3f}"
    return holds(int(wrong), "finite, within bounds, as in arrays", note=note)


NORMALS: dict[str, FloatArray] = {
    "of no length": np.zeros((3, 3)),
    "of length 1e-310": np.tile([0.0, 0.0, 1e-310], (3, 1)),
    "of length 1e-40": np.tile([0.0, 1e-40, 0.0], (3, 1)),
    "of length 1e-13": np.tile([1e-13, 0.0, 0.0], (3, 1)),
    "opposite at two corners": np.array([[0.0, 1, 0], [0, -1, 0], [0, 1, 0]]),
    "along the triangle": np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0]]),
}
"""Of the three corners of a triangle."""


def shares_of_the_sky(made: Callable[[], Plant]) -> Outcome:
    """Exposures from 0 to 1, of faces and of vertices, at any strength."""
    plant = made()
    values = [exposures(plant)]
    for strength in (0.0, 0.5, 1.0):
        found = exposed(plant, strength).exposure
        values.append(np.ones(2) if found is None else found)
    wrong = sum(int((~((v >= 0) & (v <= 1 + 1e-12))).sum()) for v in values)
    note = f"{float(values[0].min()):.3f} to {float(values[0].max()):.3f}"
    return holds(wrong, "from 0 to 1", note=note)


def exposure_stays(made: Callable[[], Plant], motion: Motion) -> Outcome:
    """Each face sees as much of the sky."""
    plant = made()
    here, there = exposures(plant), exposures(motion.plant(plant))
    error = float(np.abs(here - there).max())
    return same_objective(error, motion.offset_over(plant.radius))


def one_leaf() -> Outcome:
    """A single leaf of one triangle or two sees all of the sky from both sides."""
    leaves = (soup(plate(1.0)), soup(DEGENERATE["one triangle"][0]()), soup(plate(1.0) @ SLOPE))
    return exact(max(float(np.abs(exposures(leaf) - 1).max()) for leaf in leaves))


def denser_is_darker() -> Outcome:
    """Of twice as many leaves in the same ball, the first see less of the sky, time after time."""
    random = generator(0, "stability", "dense")
    leaves = unit(random.normal(size=(12_800, 3))) * random.random((12_800, 1)) ** (1 / 3)
    turns = np.array([rotation(seed) for seed in range(64)])
    corners = leaves[:, None] + np.einsum("nij,ncj->nci", turns[np.arange(12_800) % 64],
                                          at(np.zeros((12_800, 3)), 0.05))  # fmt: skip
    poles = at(np.concatenate([np.eye(3), -np.eye(3)]), 0.05)
    means = []
    for count in (100, 200, 400, 800, 1600, 3200, 6400, 12_800):
        plant = soup(np.concatenate([poles, corners[:count]]))
        means.append(float(exposures(plant)[6:106].mean()))
    wrong = sum(b >= a for a, b in pairwise(means))
    return holds(wrong, "less each time", note=f"{means[0]:.3f} down to {means[-1]:.3f}")


def crown_is_unit(made: Callable[[], FloatArray]) -> Outcome:
    """Normals bent to a crown are unit vectors, whatever the crown is, half the way and all."""
    plant = soup(made())
    bent = [crown_normals(plant, share).normals for share in (1e-12, 0.5, 1.0)]
    return exact(max(float(np.abs(np.linalg.norm(n, axis=1) - 1).max()) for n in bent))


def crown_stays(made: Callable[[], Plant], motion: Motion) -> Outcome:
    """Moved and scaled, and turned with their plant, normals of a crown are the same."""
    plant = made()
    here, there = (crown_normals(p, 0.7).normals for p in (plant, motion.plant(plant)))
    error = float(np.abs(here @ motion.turn.T - there).max())
    return same_objective(error, motion.offset_over(2 * plant.radius / len(plant.faces) ** 0.5))


@cache
def lit_tree(transmission: float) -> Plant:
    """The tree with its exposure and leaves that let light through."""
    return exposed(translucent(tree(), transmission), 1.0)


def relit(transmission: float, sun: Sun, shadows: bool, azimuth: float) -> Outcome:
    """Every pixel of the tree, drawn, against the same in arrays."""
    plant, display = lit_tree(transmission), Display()
    distance = display.distance_m(PIXELS / plant.extent)
    shot = shot_of(around(plant.positions, direction(azimuth, 8.0), distance, display))
    light = sun.light
    with ExitStack() as stack:
        buffers = stack.enter_context(PlantBuffers(plant))
        maps = stack.enter_context(SunMaps([buffers], sun.direction)) if shadows else None
        picture = draw(buffers, shot, light, shadows=maps)
        seen = surface(buffers, shot)
        depths = None if maps is None else maps.read()
    exposure = seen.exposure.astype(np.float64)
    visible, through = np.ones(len(exposure)), exposure[:, 1]
    if depths is not None:
        visible = through = sun_visible(seen.position, seen.side.astype(np.float64), depths)
    expected = shaded(
        seen.color.astype(np.float64), seen.normal.astype(np.float64), light, exposure,
        seen.transmission, seen.tint.astype(np.float64), visible, through,
    )  # fmt: skip
    apart = np.abs(picture - seen.picture(expected))
    return Outcome(float(apart.max()), STEP, "a step of eight bits", note=f"{len(exposure):,} px")


CROWDED: dict[str, Callable[[], Plant]] = {
    **{name: partial(lambda made: soup(made()), made) for name, (made, _) in DEGENERATE.items()},
    "a tree": tree,
}
"""Plants of stability, the degenerate ones among them."""

CASES = (
    *(
        Case(f"sun at {azimuth:g}, {elevation:g} degrees", "light", "exact",
             partial(sun_stands, azimuth, elevation))
        for azimuth, elevation in ((0, 0), (359.9, 0), (60, -1e-9), (0, -90), (0, 90), (45, 90))
    ),
    *(
        Case(f"a light's direction of length {length:g}", "light", "exact",
             partial(any_length, length), gl=True)
        for length in (1e-12, 1e12)
    ),
    *(
        Case(f"shading, transmission {share:g}, exposure {exposure:g}, tint {tint:g}", "light",
             "exact", partial(shading_in_fractions, share, exposure, tint))
        for share, exposure, tint in (
            (0.0, 1.0, 1.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1.0), (1.0, 0.0, 1.0), (0.3, 0.6, 5.0),
        )
    ),
    *(
        Case(f"light of a white surface, transmission {share:g}", "light", "exact",
             partial(energy, share))
        for share in (0.0, 0.4, 1.0)
    ),
    *(
        Case(f"sun in a billboard's plane, transmission {share:g}", "light", "property",
             partial(along_the_plane, share))
        for share in (0.0, 0.5, 1.0)
    ),
    *(
        Case(f"sun exactly behind a leaf, transmission {share:g}", "light", "exact",
             partial(behind_a_leaf, share))
        for share in (0.0, 0.5, 1.0)
    ),
    Case("shading without a normal", "light", "exact", without_normals),
    *(
        Case(f"drawn, normals {name}", "light", "property",
             partial(drawn_without_normals, made), gl=True)
        for name, made in NORMALS.items()
    ),
    *(
        Case(f"exposure: {name}", "light", "property", partial(shares_of_the_sky, made))
        for name, made in CROWDED.items()
    ),
    *(
        Case(f"exposure: {name}, {motion.name}", "light", "equivariance",
             partial(exposure_stays, CROWDED[name], motion))
        for name in ("coplanar", "a sphere", "a tree")
        for motion in UPRIGHT_MOTIONS
    ),
    Case("exposure of a single leaf", "light", "exact", one_leaf),
    Case("exposure of denser and denser crowns", "light", "property", denser_is_darker),
    *(
        Case(f"normals of a crown: {name}", "light", "exact", partial(crown_is_unit, made))
        for name, (made, _) in DEGENERATE.items()
    ),
    *(
        Case(f"normals of a crown: {name}, {motion.name}", "light", "equivariance",
             partial(crown_stays, CROWDED[name], motion))
        for name in ("one triangle", "coplanar", "a sphere", "a tree")
        for motion in MOTIONS
    ),
    *(
        Case(f"a tree relit, {name}{', with shadows' if shadows else ''}", "light", "exact",
             partial(relit, share, sun, shadows, azimuth), gl=True)
        for name, share, sun, azimuth in (
            ("sun at the horizon", 0.0, Sun(60, 0), 25.0),
            ("sun at the zenith", 0.0, Sun(0, 90), 25.0),
            ("sun along the view", 0.5, Sun(25, 8), 25.0),
            ("sun behind translucent leaves", 0.5, Sun(205, -0.0), 25.0),
            ("no sun", 0.5, Sun(60, -10), 140.0),
        )
        for shadows in (False, True)
    ),
)  # fmt: skip
