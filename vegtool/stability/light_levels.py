"""Levels and their light at the limits: balanced, or with the light of one sun in their colours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray
from vegtool.convert import ConvertOptions
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.lod import Level
from vegtool.plant import Plant, Role
from vegtool.refine.balance import balanced
from vegtool.refine.brightness import brightness_of
from vegtool.refine.color import LEAST_GAIN, MOST_GAIN
from vegtool.srgb import linear_from_srgb
from vegtool.stability.cameras import plate
from vegtool.stability.case import Case, Outcome, holds, same_objective
from vegtool.stability.clustering import DEGENERATE
from vegtool.stability.convert import PLAIN, REFINED, levels_of, same
from vegtool.stability.plants import MOTIONS, Motion, soup, tree

ONE = replace(PLAIN, levels=1)
ONE_REFINED = replace(REFINED, levels=1)
SUNS = {"at the horizon": "60,0", "below it": "60,-10", "at the zenith": "0,90"}


@cache
def bush() -> Plant:
    """A bush of 800 triangles, from our own generator."""
    from vegtool.growth import sample

    return sample("bush", 800)


def of_colour(plant: Plant, linear: float) -> Plant:
    """The plant in one grey, without textures."""
    color = np.array([linear, linear, linear, 1.0])
    materials = tuple(
        replace(m, base_color=color, color_texture=None, normal_texture=None, alpha_mode="opaque")
        for m in plant.materials
    )
    return replace(plant, materials=materials, colors=None)


def of_role(plant: Plant, role: Role) -> Plant:
    """The plant, all of it wood or all of it leaves."""
    return replace(plant, materials=tuple(replace(m, role=role) for m in plant.materials))


def one_sided() -> Plant:
    """Leaves in a plane that are not there from behind: half of all views show nothing."""
    plant = degenerate("coplanar")
    return replace(plant, materials=(replace(plant.materials[0], double_sided=False),))


def degenerate(name: str) -> Plant:
    """One of the plants that clusters are made of, in grey."""
    return of_colour(soup(DEGENERATE[name][0]()), 0.3)


PLANTS: dict[str, Callable[[], Plant]] = {
    **{name: partial(degenerate, name) for name in (
        "one triangle", "coplanar", "a needle of aspect 1e6", "collinear, without area",
        "zero-area triangles among others", "two points", "one leaf 1e4 times larger",
    )},
    "not there from behind": one_sided,
    "all wood": lambda: of_role(bush(), "wood"),
    "all leaves": lambda: of_role(bush(), "leaf"),
    "black": lambda: of_colour(bush(), 0.0),
    "all but black": lambda: of_colour(bush(), 1e-4),
    "hardly any light": lambda: of_colour(bush(), 1e-30),
    "white": lambda: of_colour(bush(), 1.0),
}  # fmt: skip


def coloured(plant: Plant) -> Level:
    """The plant itself as a level whose vertices have colours."""
    grey = np.tile([0.3, 0.3, 0.3, 1.0], (len(plant.positions), 1))
    bare = of_colour(plant, 1.0)
    near = levels_of(plant, ONE).levels[1].near_distance_m
    return Level("mesh", mesh=replace(bare, colors=grey), near_distance_m=near)


def out_of_range(before: npt.ArrayLike, after: npt.ArrayLike, step: float) -> int:
    """How many linear colours changed by more than gains may, a step of rounding allowed."""
    was, now = np.asarray(before, np.float64), np.asarray(after, np.float64)
    low = np.minimum(LEAST_GAIN * was, 1.0) - step
    return int((~((now >= low) & (now <= MOST_GAIN * was + step))).sum())


def balanced_twice(made: Callable[[], Plant]) -> Outcome:
    """Balanced, what a plant's pictures and triangles show is finite, changed within limits, and
    twice the same; what they cover stays."""
    plant, wrong, changed = made(), 0, 0.0
    levels = (levels_of(plant, ONE).levels[1], coloured(plant))
    with PlantBuffers(plant) as buffers:
        wanted = brightness_of(buffers, ONE.display)
    wrong += int((~np.isfinite(wanted.values)).sum())
    for level in levels:
        one, two = (balanced(level, plant, wanted) for _ in range(2))
        wrong += not same(one, two)
        if level.atlas is not None and one.atlas is not None:
            codes = (level.atlas.color, one.atlas.color)
            wrong += int((codes[0][..., 3] != codes[1][..., 3]).sum())
            was, now = (linear_from_srgb(c[..., :3] / 255.0) for c in codes)
            wrong += out_of_range(was, now, 0.01)
            changed = max(changed, float(np.abs(now - was).max()))
        if level.mesh is not None and one.mesh is not None:
            assert level.mesh.colors is not None and one.mesh.colors is not None
            wrong += out_of_range(level.mesh.colors, one.mesh.colors, 1e-12)
            length = np.linalg.norm(one.mesh.normals, axis=1)
            wrong += int((~(length < 1 + 1e-9)).sum())
            wrong += not np.array_equal(one.mesh.positions, level.mesh.positions)
    return holds(
        wrong, "finite, within limits, twice the same", note=f"changed by up to {changed:.3f}"
    )


def balanced_bytes(level: Level) -> list[npt.NDArray[np.uint8]]:
    """What is written of the pictures of a level."""
    assert level.atlas is not None and level.atlas.normal is not None
    return [level.atlas.color, level.atlas.normal]


def balance_stays(motion: Motion) -> Outcome:
    """Moved and scaled, the tree is as bright and its level is balanced to the same bytes; far from
    the origin, where positions are rounded, to the same pictures."""
    found = []
    for plant in (tree(), motion.plant(tree())):
        level = levels_of(plant, ONE).levels[1]
        with PlantBuffers(plant) as buffers:
            wanted = brightness_of(buffers, ONE.display)
        found.append((wanted.values, balanced_bytes(balanced(level, plant, wanted))))
    (values, here), (others, there) = found
    if any(a.shape != b.shape for a, b in zip(here, there, strict=True)):
        return holds(1, "the same textures")
    apart = [np.abs(a.astype(np.float64) - b) / 255 for a, b in zip(here, there, strict=True)]
    other = sum(int((a > 0).sum()) for a in apart)
    note = f"{other} bytes differ, by {255 * max(float(a.max()) for a in apart):.0f} at most"
    error = float(np.abs(values / others - 1).max())
    if motion.offset:
        error = max(error, *(float(a.mean()) for a in apart))
        return Outcome(error, 1e-4, "a sample on an edge may fall to its other side", note=note)
    return same_objective(error + other, note=note)


def colours_of(level: Level) -> FloatArray:
    """(n, 3) of the texels that are shown, as encoded, and of the mesh's vertices, linear."""
    parts = [np.zeros((0, 3))]
    if level.atlas is not None:
        for x, y, w, h in level.atlas.front.tolist():
            picture = level.atlas.color[y : y + h, x : x + w]
            parts.append(picture[picture[..., 3] > 127][:, :3] / 255.0)
    if level.mesh is not None:
        assert level.mesh.colors is not None
        parts.append(level.mesh.colors[:, :3])
    return np.concatenate(parts)


def prelit(plant: Plant, options: ConvertOptions, sun: str) -> tuple[Level, ...]:
    """Its levels with the light of that sun in their colours."""
    return levels_of(plant, replace(options, prelit=True, sun=sun)).levels[1:]


def lit_twice(made: Callable[[], Plant], options: ConvertOptions, sun: str) -> Outcome:
    """Levels that need no light, of colours from 0 to 1, twice the same."""
    one, two = (prelit(made(), options, sun) for _ in range(2))
    wrong = int(not one)
    for a, b in zip(one, two, strict=True):
        wrong += not same(a, b) or not a.unlit
        wrong += int((~((colours_of(a) >= 0) & (colours_of(a) <= 1))).sum())
    shown = np.concatenate([colours_of(level) for level in one])
    note = f"{shown.mean():.3f} on average" if len(shown) else "nothing is shown"
    return holds(int(wrong), "colours from 0 to 1, twice the same", note=note)


def black_stays_black(options: ConvertOptions) -> Outcome:
    """Whatever the sun, a black plant is black."""
    levels = prelit(of_colour(bush(), 0.0), options, SUNS["at the zenith"])
    wrong = sum(int((colours_of(level) != 0).sum()) for level in levels)
    return holds(wrong + (not levels), "black")


def white_leaf(upright: bool, sun: str, right: float) -> Outcome:
    """A white leaf: the mean of the light on both of its sides, whatever it lets through."""
    leaf = soup(plate(1.0) if upright else plate(1.0)[..., [0, 2, 1]])
    if upright:
        leaf = replace(leaf, normals=np.tile([0.0, 0.0, 1.0], (6, 1)))
    error = 0.0
    for share in (0.0, 0.4, 1.0):
        (level,) = prelit(leaf, replace(ONE, translucency=share), sun)
        apart = linear_from_srgb(colours_of(level)) - right
        error = max(error, float(np.abs(apart).max()))
    return Outcome(error, 0.01, "a byte of sRGB, there and in the picture of samples")


def below_is_none(options: ConvertOptions) -> Outcome:
    """Below the horizon it does not matter where the sun stands, as there is none."""
    here, there = (prelit(tree(), options, sun) for sun in ("60,-10", "200,-80"))
    wrong = sum(not same(a, b) for a, b in zip(here, there, strict=True))
    return holds(wrong + (not here), "the same bytes")


def sky_alone() -> Outcome:
    """Below the horizon, levels are those that are baked with no sun and no shadows of one."""
    from vegtool.convert import level_maker
    from vegtool.gl.sun import SunMaps
    from vegtool.measure.chain import views_of
    from vegtool.measure.scores import Shadowed, TruthsAt
    from vegtool.progress import silent
    from vegtool.refine.occlusion import exposed
    from vegtool.stability.convert import OFF

    (level,) = prelit(tree(), ONE, SUNS["below it"])
    plant = exposed(tree(), 1.0)
    nothing = soup(np.zeros((1, 3, 3)))
    with (
        PlantBuffers(plant) as buffers,
        PlantBuffers(nothing) as caster,
        SunMaps([caster], np.array([0.0, 1.0, 0.0])) as maps,
    ):
        under = Shadowed(Light(sun=0.0), maps)
        truth_at = TruthsAt(plant, views_of(OFF), ONE.display, buffers, under)
        make = level_maker(buffers, truth_at, ONE)
        other = make(ONE.billboards, level.near_distance_m, silent)
    return holds(int(not same(level, other)), "the same bytes")


CASES = (
    *(
        Case(f"balance: {name}", "light", "property", partial(balanced_twice, made), gl=True)
        for name, made in PLANTS.items()
    ),
    *(
        Case(f"balance: a tree, {motion.name}", "light", "equivariance",
             partial(balance_stays, motion), gl=True)
        for motion in MOTIONS
        if not motion.turns  # other pixels are drawn
    ),
    *(
        Case(f"prelit: {name}, sun {where}", "light", "property",
             partial(lit_twice, PLANTS[name], ONE, sun), gl=True)
        for name in PLANTS
        if not name.startswith(("all ", "hardly"))  # lit as others are
        for where, sun in SUNS.items()
    ),
    *(
        Case(f"prelit: {name}, refined, sun {where}", "light", "property",
             partial(lit_twice, PLANTS[name], ONE_REFINED, SUNS[where]), gl=True)
        for name, where in (
            ("one triangle", "at the horizon"), ("coplanar", "at the horizon"),
            ("collinear, without area", "at the zenith"), ("two points", "below it"),
            ("zero-area triangles among others", "at the zenith"),
            ("not there from behind", "below it"), ("white", "at the zenith"),
        )
    ),
    *(
        Case(f"prelit: a black bush{said}", "light", "property",
             partial(black_stays_black, options), gl=True)
        for options, said in ((ONE, ""), (ONE_REFINED, ", refined"))
    ),
    *(
        Case(f"prelit: a white leaf, {'upright' if upright else 'level'}, sun at {sun} degrees",
             "light", "property", partial(white_leaf, upright, sun, right), gl=True)
        for upright, sun, right in (
            (False, "0,90", 0.64), (False, "0,0", 0.29), (False, "0,-10", 0.29),
            (True, "0,0", 0.64), (True, "0,90", 0.29), (True, "180,0", 0.64),
        )
    ),
    *(
        Case(f"prelit: a tree, suns below the horizon{said}", "light", "property",
             partial(below_is_none, options), gl=True)
        for options, said in ((ONE, ""), (ONE_REFINED, ", refined"))
    ),
    Case("prelit: a tree, the sun below the horizon, and none", "light", "property", sky_alone,
         gl=True),
)  # fmt: skip
