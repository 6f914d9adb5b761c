"""What throws a plant's shadow with few triangles: a level, stripped to its silhouette.

A shadow map asks what covers the sun and nothing else, is drawn for every light and every cascade,
and is coarse. So its caster may have far fewer triangles than what is looked at. It is a level like
the others (refine/level.py): that keeps the plant's coverage from all around. Colours, normals and
light are taken out of it; what is left is alpha and a shape.

A sun draws no back faces away: both sides of a leaf are in its way. So a billboard with a picture
on each side gets one, of what either covers; and the plant that it is compared with, from suns that
it was not made by, is drawn from both sides too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vegtool.arrays import ByteArray
from vegtool.baking.options import BakeOptions
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Atlas, Display, Level, ShadowProxy, Spread
from vegtool.measure.distances import rounded_up
from vegtool.measure.scores import Scores, TruthsAt, scores, truths
from vegtool.measure.views import View, distance_of, views
from vegtool.plant import Material, Plant

PIXELS = 100.0
"""Size of the plant's longest extent where its silhouettes are measured: of a tree 10 m high, a
texel of the shadow map is 10 cm."""
PARALLEL = Display(fov_y_deg=5.0)
"""So narrow an angle that rays are as good as parallel, which a sun's are."""
VIEWS = 6
"""By which its coverage is made the plant's."""
SUNS = 12
"""From 15 to 75 degrees above the horizon, all around (measure/views.py)."""
METRICS = ("coverage_bias", "silhouette")
"""What is measured of a silhouette."""


Make = Callable[[PlantBuffers, TruthsAt, float], Level]
"""Makes a level of a plant, beside its truths, for distances from so many metres on."""


def shadow_proxy(plant: Plant, display: Display, make: Make, near_m: float) -> ShadowProxy:
    """What throws the plant's shadow, and how wrong its silhouettes are.

    make: with as many triangles as there may be. near_m: the distance that it is made for, or that
    of PIXELS, the nearer one. Raises CapabilityError where OpenGL cannot draw.
    """
    near_m = min(near_m, rounded_up(distance_of(plant, display, PIXELS)))
    casting = _from_both_sides(plant)
    with PlantBuffers(casting) as buffers:
        truth_at = TruthsAt(casting, views("all", VIEWS), display, buffers)
        level = as_caster(make(buffers, truth_at, near_m))
    suns = tuple(View(view.sun, view.sun) for view in views("all", SUNS))
    true = truths(casting, suns, [PIXELS], PARALLEL)
    with PlantBuffers(casting, mipmaps=True) as drawn:
        live = scores(true, drawn)
    return ShadowProxy(level, PIXELS, SUNS, _spreads(scores(true, level)), _spreads(live))


def as_caster(level: Level) -> Level:
    """The level's silhouette: white, unlit, without normal texture, its quads drawn from both
    sides."""
    mesh = None if level.mesh is None else _white(level.mesh, colored=level.kind == "hybrid")
    atlas = None if level.atlas is None else _outline(level.atlas, level.double_sided)
    return replace(level, mesh=mesh, atlas=atlas, double_sided=True, unlit=True)


def _white(mesh: Plant, colored: bool) -> Plant:
    """The mesh in one white material. colored: its vertices have a colour all the same."""
    material = Material(mesh.name, double_sided=True, unlit=True)
    colors = np.ones((len(mesh.positions), 4)) if colored else None
    one = np.zeros(len(mesh.faces), dtype=np.int32)
    return replace(
        mesh, colors=colors, exposure=None, face_material=one, materials=(material,), branches=None
    )


def _outline(atlas: Atlas, double_sided: bool) -> Atlas:
    """The atlas with its alpha alone; of two pictures of a billboard, the front's has both's."""
    color = np.full_like(atlas.color, 255)
    color[..., 3] = atlas.color[..., 3] if double_sided else _either(atlas)
    return Atlas(color, None, np.zeros_like(atlas.depth), atlas.front, atlas.front, atlas.white)


def _either(atlas: Atlas) -> ByteArray:
    """(h, w) alpha of what either side covers where the front's pictures are, 0 where the back's
    are. The back's are stored mirrored: the same place on the plane lies at the same texel."""
    alpha, gutter = atlas.color[..., 3].copy(), BakeOptions().gutter
    for front, back in zip(atlas.front, atlas.back, strict=True):
        if np.array_equal(front, back):
            continue
        x, y, width, height = back
        behind = np.s_[y - gutter : y + height + gutter, x - gutter : x + width + gutter]
        if np.array_equal(front[2:], back[2:]):  # else nothing is there, and one texel shows it
            x, y = front[:2]
            shown = np.s_[y - gutter : y + height + gutter, x - gutter : x + width + gutter]
            alpha[shown] = np.maximum(alpha[shown], alpha[behind])
        alpha[behind] = 0
    return alpha


def _from_both_sides(plant: Plant) -> Plant:
    """The plant as what is in the sun's way."""
    materials = tuple(replace(m, double_sided=True) for m in plant.materials)
    return replace(plant, materials=materials)


def _spreads(found: Scores) -> dict[str, Spread]:
    return {name: found.spread(name, 0) for name in METRICS}
