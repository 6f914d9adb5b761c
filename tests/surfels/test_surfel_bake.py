"""Textures of surfel billboards: how large, and what they show of which side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lod import Display
from vegtool.plant import Material, Plant
from vegtool.surfels.bake import SurfelAtlas, baked, planned
from vegtool.surfels.base import Base, base_of
from vegtool.surfels.cuts import coarsest, drawn
from vegtool.surfels.hierarchy import MOST_TEXELS, SurfelHierarchy, whole
from vegtool.surfels.margin import MARGIN, billboards_of
from vegtool.surfels.merging import merged
from vegtool.surfels.multi_triangulation import multi_triangulation
from vegtool.surfels.reduce import reduced
from vegtool.surfels.texture_size import texture_sizes
from vegtool.surfels.validity import image_size, texel_error, z_min

pytestmark = pytest.mark.gl
PC = Display().pixels_per_metre(1.0)


def card(double_sided: bool) -> Plant:
    """A metre square in the xy plane, red, seen from +z, and from behind where that is asked."""
    p = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    red = Material("red", base_color=np.array([1.0, 0, 0, 1]), double_sided=double_sided)
    return Plant(
        "card", p, np.tile([0.0, 0, 1], (4, 1)), np.zeros((4, 2)), faces,
        np.zeros(2, np.int32), (red,),
    )  # fmt: skip


def of(plant: Plant, least: float = 0.05) -> tuple[SurfelHierarchy, SurfelAtlas]:
    base = Base(plant.corners, np.array([0]), np.zeros(1), np.zeros((1, 3)), np.ones(1))
    one = whole(base, merged(base.corners, base.first), 0.5, least)
    with PlantBuffers(plant) as buffers:
        found = baked(buffers, planned(buffers, base.first.astype(np.int32), one, 1024))
    return one, found


def test_a_texel_covers_epsilon_at_z_min() -> None:
    """By equation 9 turned round; rounding up makes texels smaller, never larger, and margins are
    of a quarter of one on each side."""
    mt = multi_triangulation(sample("statue", 4000))
    base = base_of(mt)
    one = reduced(base, whole(base, merged(base.corners, base.first), 0.5, 0.002))
    sizes = texture_sizes(one)
    for epsilon in (0.5, 3.0):
        z = z_min(one.error, epsilon, PC)
        wide = image_size(2 * one.boxes.half[:, 0], z, PC) / epsilon
        assert (np.abs(sizes[:, 0] - wide) <= 1 + 2 * MARGIN + 1e-9).all()
        drawn_half = billboards_of(one).half_size
        assert (texel_error(drawn_half, sizes, z, PC) <= epsilon * (1 + 1e-9)).all()


def test_what_is_flat_has_no_more_than_the_most() -> None:
    one, _ = of(card(False))
    assert texture_sizes(one)[0].tolist() == [21, 21], "a metre over five centimetres, and margins"
    one, _ = of(card(False), least=0.0)
    assert texture_sizes(one)[0].tolist() == [MOST_TEXELS + 1, MOST_TEXELS + 1]
    assert one.error[0] == pytest.approx(1 / MOST_TEXELS), "and is used where these are pixels"


@pytest.mark.parametrize("double_sided", [True, False])
def test_the_wrong_side_is_dropped_where_nothing_is_seen(double_sided: bool) -> None:
    _, found = of(card(double_sided))
    assert found.behind.tolist() == [double_sided]
    x, y, w, h = found.atlas.front[0].tolist()
    texels = found.atlas.color[y : y + h, x : x + w]
    assert (texels[1:-1, 1:-1, 3] == 255).all() and (texels[..., 0] == 255).all()
    assert (texels[0, 1:-1, 3] < 255).all(), "of its margin it covers nothing"
    assert np.array_equal(found.atlas.front, found.atlas.back), "one picture serves both sides"
    assert (found.atlas.depth[y + 1 : y + h - 1, x + 1 : x + w - 1] == 32768).all(), "on the plane"


def test_two_colours_have_two_pictures() -> None:
    front, back = card(False), card(False)
    green = replace(front.materials[0], name="green", base_color=np.array([0.0, 1, 0, 1]))
    both = replace(
        front,
        positions=np.concatenate([front.positions, back.positions - [0, 0, 0.02]]),
        normals=np.concatenate([front.normals, -back.normals]),
        uvs=np.zeros((8, 2)),
        faces=np.concatenate([front.faces, 4 + back.faces[:, ::-1]]).astype(np.int32),
        face_material=np.array([0, 0, 1, 1], dtype=np.int32),
        materials=(front.materials[0], green),
    )
    one, found = of(both)
    assert found.behind.all() and not np.array_equal(found.atlas.front, found.atlas.back)
    colors = []
    for rect in (found.atlas.front[0], found.atlas.back[0]):
        x, y, w, h = rect.tolist()
        colors.append(found.atlas.color[y : y + h, x : x + w, :3].reshape(-1, 3).mean(axis=0))
        depth = found.atlas.depth[y : y + h, x : x + w].astype(int)
        before = 0.01 / billboards_of(one).half_depth[0]
        assert np.abs(depth[1:-1, 1:-1] - 32768 * (1 + before)).max() < 2
    up = float(billboards_of(one).normal[0, 2])
    first, second = colors if up > 0 else colors[::-1]
    assert first.argmax() == 0 and second.argmax() == 1


def test_the_same_hierarchy_has_the_same_textures() -> None:
    mt = multi_triangulation(sample("statue", 2000))
    base = base_of(mt)
    one = reduced(base, whole(base, merged(base.corners, base.first), 0.5, 0.004))
    sizes = texture_sizes(one)
    with PlantBuffers(drawn(mt, coarsest(mt))) as buffers:
        plan = planned(buffers, base.first.astype(np.int32), one, 4096)
        some, other = (baked(buffers, plan) for _ in range(2))
    for name in ("color", "normal", "depth", "front", "back"):
        assert np.array_equal(getattr(some.atlas, name), getattr(other.atlas, name))
    assert (some.atlas.front[:, 2:] == sizes).all()
    covered = [
        (some.atlas.color[y : y + h, x : x + w, 3] > 0).mean()
        for x, y, w, h in some.atlas.front.tolist()
    ]
    assert min(covered) > 0.1, "each shows something"
