from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from baking_cases import billboards, leafy, picture, plain, quads, texture

from vegtool.baking.bake import MOST_SAMPLES, WHITE, BakeOptions, bake, fit, pairs, whiten
from vegtool.errors import UsageError
from vegtool.gl.context import describe
from vegtool.gl.mipmaps import mip_levels
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Billboards
from vegtool.plant import Material, Plant

pytestmark = pytest.mark.gl
ZERO = np.zeros(2, dtype=np.int32)
"""Two faces of one cluster."""


@pytest.fixture
def alpha_as_baked(monkeypatch):
    """Alpha is the coverage itself, before baking/coverage.py fits it to the alpha test."""
    monkeypatch.setattr("vegtool.baking.bake.coverage_kept", lambda alpha, *_: alpha)


def cut(atlas, index=0, which="front"):
    """A picture's colour, normal and depth."""
    x, y, w, h = getattr(atlas, which)[index]
    at = np.s_[y : y + h, x : x + w]
    return atlas.color[at].astype(int), atlas.normal[at].astype(int), atlas.depth[at].astype(int)


def test_a_square_in_the_plane_fills_its_picture_exactly():
    plant = quads([[0, 0, 0]], materials=(plain((10, 120, 250, 255)),))
    baked = bake(plant, ZERO, billboards([[0, 0, 0]], 1.0), 4.0)
    color, normal, depth = cut(baked.atlas)
    assert color.shape == (8, 8, 4)
    assert (color == [10, 120, 250, 255]).all()
    assert (normal == [128, 128, 255]).all()
    assert (depth == 32768).all()
    assert baked.double_sided
    assert (baked.atlas.front == baked.atlas.back).all()


@pytest.mark.parametrize("level", [0, 1, 3, 12, 60, 128, 254, 255])
def test_a_colour_survives_the_bake_unchanged(level):
    plant = quads([[0, 0, 0]], materials=(plain((level, level, level, 255)),))
    color, _, _ = cut(bake(plant, ZERO, billboards([[0, 0, 0]], 1.0), 2.0).atlas)
    assert np.abs(color[..., :3] - level).max() <= 1


def test_the_picture_stands_upright():
    """The texture's top left texel ends at the picture's top left: -u and +v."""
    corners = np.array([[[255, 0, 0, 255], [0, 255, 0, 255]], [[0, 0, 255, 255], [9, 9, 9, 255]]])
    image = texture(corners.repeat(8, axis=0).repeat(8, axis=1))
    plant = quads([[0, 0, 0]], materials=(Material("m", color_texture=image),))
    color, _, _ = cut(bake(plant, ZERO, billboards([[0, 0, 0]], 1.0), 8.0).atlas)
    assert tuple(color[2, 2, :3]) == (255, 0, 0)
    assert tuple(color[2, -3, :3]) == (0, 255, 0)
    assert tuple(color[-3, 2, :3]) == (0, 0, 255)


def test_coverage_of_a_triangle_is_its_area():
    square = quads([[0, 0, 0]])
    plant = replace(square, faces=square.faces[:1], face_material=square.face_material[:1])
    baked = bake(plant, ZERO[:1], billboards([[0, 0, 0]], 1.0), 16.0)
    color, _, _ = cut(baked.atlas)
    assert color[..., 3].mean() / 255 == pytest.approx(0.5, abs=0.01)


def test_black_and_white_average_in_linear_light():
    """Half the light is sRGB 188, not 128."""
    image = np.zeros((64, 64, 4), dtype=np.uint8)
    image[..., 3] = 255
    image[:, ::2, :3] = 255
    plant = quads([[0, 0, 0]], materials=(Material("m", color_texture=texture(image)),))
    color, _, _ = cut(bake(plant, ZERO, billboards([[0, 0, 0]], 1.0), 2.0).atlas)
    assert np.abs(color[..., :3] - 188).max() <= 1


def test_a_cut_out_checkerboard_becomes_coverage_and_keeps_its_colour():
    image = np.zeros((16, 16, 4), dtype=np.uint8)
    image[::2, ::2] = image[1::2, 1::2] = [40, 160, 20, 255]
    leaf = Material("m", color_texture=texture(image), alpha_mode="mask", double_sided=True)
    plant = quads([[0, 0, 0]], materials=(leaf,))
    baked = bake(plant, ZERO, billboards([[0, 0, 0]], 1.0), 2.0, BakeOptions(supersample=8))
    color, _, _ = cut(baked.atlas)
    assert color[..., 3].mean() / 255 == pytest.approx(0.5, abs=0.05)
    assert np.abs(color[..., :3] - [40, 160, 20]).max() <= 1  # black under alpha 0 stays out


def test_opaque_materials_ignore_alpha():
    plant = quads([[0, 0, 0]], materials=(plain((9, 9, 9, 0)),))
    color, _, _ = cut(bake(plant, ZERO, billboards([[0, 0, 0]], 1.0), 2.0).atlas)
    assert (color == [9, 9, 9, 255]).all()


def test_factors_and_vertex_colours_multiply_in_linear_light():
    """White x 0.5 x 0.5 is a quarter of the light: sRGB 137."""
    material = Material("m", np.array([0.5, 0.5, 0.5, 1.0]))
    plant = replace(quads([[0, 0, 0]], materials=(material,)), colors=np.full((4, 4), 0.5))
    color, _, _ = cut(bake(plant, ZERO, billboards([[0, 0, 0]], 1.0), 2.0).atlas)
    assert np.abs(color[..., :3] - 137).max() <= 1


def test_the_nearer_surface_wins_on_either_side():
    plant = quads(
        [[0, 0, 0.5], [0, 0, -0.5]],
        materials=(plain((255, 0, 0, 255)), plain((0, 0, 255, 255))),
        face_material=[0, 1],
    )
    baked = bake(plant, np.zeros(4, np.int32), billboards([[0, 0, 0]], 1.0), 4.0)
    assert not baked.double_sided  # red before, blue behind
    color, normal, depth = cut(baked.atlas, which="front")
    assert (color[..., :3] == [255, 0, 0]).all()
    assert (normal == [128, 128, 255]).all()
    assert np.abs(depth - (32768 + 32767 * 0.5)).max() <= 2
    color, normal, depth = cut(baked.atlas, which="back")
    assert (color[..., :3] == [0, 0, 255]).all()
    assert (normal == [128, 128, 255]).all()  # towards the viewer behind
    assert np.abs(depth - (32768 + 32767 * 0.5)).max() <= 2  # and so is depth


def test_a_single_sided_surface_is_baked_from_the_side_that_shows_it():
    """The plane's normal is -z, the square faces +z: the billboard is turned round."""
    plant = quads([[0, 0, 0]], materials=(plain((7, 7, 7, 255), double_sided=False),))
    board = billboards([[0, 0, 0]], 1.0, u=(-1.0, 0, 0))
    baked = bake(plant, ZERO, board, 4.0, BakeOptions(sides="double"))
    assert (baked.billboards.u == [[1, 0, 0]]).all()
    assert (cut(baked.atlas)[0][..., 3] == 255).all()


def test_the_empty_back_of_a_single_sided_surface_takes_one_texel():
    plant = quads([[0, 0, 0]], materials=(plain(double_sided=False),))
    baked = bake(plant, ZERO, billboards([[0, 0, 0]], 1.0), 4.0)
    assert not baked.double_sided
    assert tuple(baked.atlas.back[0, 2:]) == (1, 1)
    assert (cut(baked.atlas, which="back")[0][..., 3] == 0).all()


def test_sides_that_agree_share_their_picture_in_an_opposite_level():
    plant = quads(
        [[0, 0, 0], [4, 0, 0]], materials=(plain(double_sided=False), plain()), face_material=[0, 1]
    )
    baked = bake(
        plant,
        np.array([0, 0, 1, 1]),
        billboards([[0, 0, 0], [4, 0, 0]], 1.0),
        4.0,
        BakeOptions(sides="opposite"),
    )
    assert not baked.double_sided
    assert (baked.atlas.front[0] != baked.atlas.back[0]).any()
    assert (baked.atlas.front[1] == baked.atlas.back[1]).all()


def test_a_leaf_whose_normal_leans_needs_a_picture_of_its_own_behind():
    """Behind, its normal turns round whole; a shared picture would keep its lean along the plane.
    The sides of closed wood keep theirs, and share."""
    board, opposite = billboards([[0, 0, 0]], 1.0), BakeOptions(sides="opposite")
    leaf = quads([[0, 0, 0]], normal=(0.6, 0, 0.8), materials=(plain(),))
    leaf = replace(leaf, materials=(replace(leaf.materials[0], double_sided=True),))
    atlas = bake(leaf, ZERO, board, 4.0, opposite).atlas
    assert (atlas.front != atlas.back).any()
    front, back = (cut(atlas, 0, side)[1].mean(axis=(0, 1)) - 127.5 for side in ("front", "back"))
    assert front[0] > 50 > -50 > back[0]

    wood = quads([[0, 0, 0], [0, 0, -0.5]], materials=(plain(double_sided=True),))
    leaning = np.repeat([[0.6, 0, 0.8], [0.6, 0, -0.8]], 4, axis=0)
    faces = np.concatenate([wood.faces[:2], wood.faces[2:, ::-1]])  # the far side looks away
    wood = replace(wood, normals=leaning, faces=faces)
    labels = np.zeros(4, dtype=np.int32)
    atlas = bake(wood, labels, board, 4.0, opposite).atlas
    assert (atlas.front == atlas.back).all()


def test_normals_are_unit_vectors_wherever_they_point():
    """Seen from behind, glTF reverses the normal; one that then points away stays so, as it would
    in a client: of random ones half do."""
    rng = np.random.default_rng(0)
    plant = leafy(rng, 60)
    tilted = rng.normal(size=(180, 3))
    plant = replace(plant, normals=tilted / np.linalg.norm(tilted, axis=1, keepdims=True))
    baked = bake(plant, np.zeros(60, np.int32), billboards([[0, 0, 0]], 1.3, 1.3), 16.0)
    unit = baked.atlas.normal[baked.atlas.color[..., 3] > 0] / 127.5 - 1
    assert 0.3 < (unit[:, 2] < 0).mean() < 0.7
    assert np.abs(np.linalg.norm(unit, axis=1) - 1).max() < 0.02


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("behind", [False, True])
def test_a_normal_map_tilts_along_u_and_v(mirrored, behind):
    """A texel leaning to the texture's right and top leans to +x and +y; mirrored texture
    coordinates mirror it; from behind, the whole normal is reversed as in a client."""
    lean = np.array([0.6, 0.5, np.sqrt(1 - 0.61)])
    image = texture(np.append(np.rint(lean * 127.5 + 127.5), 255)[None, None])
    material = Material("m", normal_texture=image, double_sided=True)
    plant = quads([[0, 0, 0]], materials=(material,))
    if mirrored:
        plant = replace(plant, uvs=plant.uvs * [-1, 1] + [1, 0])
    board = billboards([[0, 0, 0]], 1.0, u=(-1.0, 0, 0) if behind else (1.0, 0, 0))
    _, normal, _ = cut(bake(plant, ZERO, board, 4.0).atlas)
    world = np.array([-lean[0] if mirrored else lean[0], lean[1], lean[2]])
    frame = np.array([[-1.0, 0, 0], [0, 1, 0], [0, 0, -1]]) if behind else np.eye(3)
    expected = frame @ (-world if behind else world)
    assert np.abs(normal / 127.5 - 1 - expected).max() < 0.02


@pytest.mark.parametrize("seed", range(3))
def test_every_texel_agrees_with_the_plain_rasteriser(seed, alpha_as_baked):
    rng = np.random.default_rng(seed)
    plant = leafy(rng, 24)
    labels = (np.arange(24) % 2).astype(np.int32)
    u = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    board = billboards(np.zeros((2, 3)), (1.3, 1.2), 1.6, u=u[0], v=u[1])
    baked = bake(plant, labels, board, 3.0, BakeOptions(sides="opposite"))
    board, samples = baked.billboards, MOST_SAMPLES  # small atlases get the most
    for index in range(2):
        for side, which in ((1, "front"), (-1, "back")):
            if side < 0 and (baked.atlas.back[index] == baked.atlas.front[index]).all():
                continue
            color, normal, depth = cut(baked.atlas, index, which)
            size = color.shape[1], color.shape[0]
            faces = np.flatnonzero(labels == index)
            want, n, z = picture(plant, faces, board, index, size, samples, side)
            assert np.abs(color[..., 3] / 255 - want[..., 3]).max() < 1.5 / samples**2
            covered = color[..., 3] > 0
            agree = covered & (np.abs(color[..., 3] / 255 - want[..., 3]) < 1e-2)
            assert agree.sum() >= 0.9 * covered.sum() > 0  # the rest: samples on an edge
            # not less, for the ring of colour put under alpha 0 that the plain way does not have
            assert np.abs(color[agree][:, :3] / 255 - want[agree][:, :3]).max() < 0.02
            assert np.abs(normal[agree] / 255 - n[agree]).max() < 0.004
            assert np.abs((depth[agree] - 32768) / 32767 - side * z[agree]).max() < 1e-3


def test_a_moved_and_turned_plant_has_the_same_atlas():
    rng = np.random.default_rng(3)
    plant = leafy(rng, 40)
    board = billboards([[0, 0, 0]], (1.5, 1.5), 1.5)
    labels = np.zeros(40, dtype=np.int32)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    move = np.array([300.0, -20.0, 70.0])
    moved = replace(
        plant, positions=plant.positions @ turn.T + move, normals=plant.normals @ turn.T
    )
    there = Billboards(
        board.center @ turn.T + move,
        board.u @ turn.T,
        board.v @ turn.T,
        board.half_size,
        board.half_depth,
        board.cluster,
    )
    a, b = (bake(p, labels, q, 12.0).atlas for p, q in ((plant, board), (moved, there)))
    assert (a.front == b.front).all()
    # a sample on an edge may fall on its other side: one of many, in few texels
    difference = np.abs(a.color.astype(int) - b.color)
    assert (difference[..., 3] > 1).mean() < 0.002
    same = difference[..., 3] <= 1
    assert (difference[same] > 1).any(axis=1).mean() < 0.01


def test_the_same_input_gives_the_same_bytes_and_one_upload_serves_many_levels():
    plant = leafy(np.random.default_rng(4), 50)
    labels = (np.arange(50) % 5).astype(np.int32)
    board = billboards(np.zeros((5, 3)), 1.5, 1.5)
    alone = bake(plant, labels, board, 10.0).atlas
    with PlantBuffers(plant) as buffers:
        bake(buffers, labels, board, 33.0)
        shared = bake(buffers, labels, board, 10.0).atlas
    for name in ("color", "normal", "depth", "front"):
        assert (getattr(alone, name) == getattr(shared, name)).all()
    assert buffers.ctx.error == "GL_NO_ERROR"


def test_tiles_meet_without_a_seam(monkeypatch):
    plant = leafy(np.random.default_rng(5), 50)
    labels = (np.arange(50) % 5).astype(np.int32)
    board = billboards(np.zeros((5, 3)), 1.5, 1.5)
    whole = bake(plant, labels, board, 10.0).atlas
    limits = replace(describe(), max_texture=300)
    monkeypatch.setattr("vegtool.gl.pictures.describe", lambda _: limits)
    monkeypatch.setattr("vegtool.gl.pictures.SAMPLE_LIMIT", 9_000)
    tiled = bake(plant, labels, board, 10.0).atlas
    assert (np.abs(whole.color.astype(int) - tiled.color) > 1).any(axis=-1).mean() < 0.002


def test_geometry_outside_a_rectangle_does_not_reach_the_neighbours():
    plant = quads([[0, 0, 0], [9, 0, 0]], half=[3.0, 1.0])
    board = billboards([[0, 0, 0], [9, 0, 0]], 1.0)
    atlas = bake(plant, np.array([0, 0, 1, 1]), board, 8.0).atlas
    depth = np.zeros(atlas.depth.shape, np.uint16)
    for x, y, w, h in atlas.front:
        depth[y : y + h, x : x + w] = 32768
        assert (atlas.color[y : y + h, x : x + w, 3] == 255).all()
    assert np.array_equal(atlas.depth, depth)


def test_crossed_planes_each_show_the_whole_cluster():
    face, shown_by = pairs(np.array([1, 0, 1, 2]), np.array([0, 1, 1, 3]))
    assert sorted(zip(face.tolist(), shown_by.tolist(), strict=True)) == [
        (0, 1), (0, 2), (1, 0), (2, 1), (2, 2),
    ]  # fmt: skip


def test_faces_of_no_cluster_are_on_no_billboard():
    face, shown_by = pairs(np.array([-1, 0, -1, 1]), np.array([1, 0]))
    assert sorted(zip(face.tolist(), shown_by.tolist(), strict=True)) == [(1, 1), (3, 0)]


@pytest.mark.parametrize("double_sided", ["double", "opposite"])
def test_a_white_block_lies_beside_the_pictures_and_changes_none(double_sided):
    plant = leafy(np.random.default_rng(8), 60)
    labels = (np.arange(60) % 3).astype(np.int32)
    planes = billboards([[0, 0, 0], [0.2, 0, 0], [0, 0.3, 0]], 1.2, 1.5)
    options = BakeOptions(sides=double_sided)
    plain_level = bake(plant, labels, planes, 20.0, options)
    atlas = bake(plant, labels, planes, 20.0, options, white=True).atlas
    assert plain_level.atlas.white is None
    for which in ("front", "back"):
        for index in range(3):
            for mine, theirs in zip(
                cut(atlas, index, which), cut(plain_level.atlas, index, which), strict=True
            ):
                np.testing.assert_allclose(mine, theirs, atol=1)  # it lies elsewhere
    x, y, w, h = atlas.white
    assert (w, h) == (WHITE, WHITE)
    gutter = options.gutter
    block = np.s_[y - gutter : y + h + gutter, x - gutter : x + w + gutter]
    assert atlas.color[block].shape[:2] == (WHITE + 2 * gutter, WHITE + 2 * gutter)
    assert (atlas.color[block] == 255).all()
    assert (atlas.normal[block] == [128, 128, 255]).all()
    assert not atlas.depth[block].any()
    for px, py, pw, ph in np.concatenate([atlas.front, atlas.back]):
        apart = px >= x + w + 2 * gutter or px + pw + 2 * gutter <= x
        assert apart or py >= y + h + 2 * gutter or py + ph + 2 * gutter <= y


@pytest.mark.parametrize("x", range(4))
@pytest.mark.parametrize("y", [0, 1])
def test_the_middle_of_a_white_block_is_white_in_the_first_mip_too(x, y):
    """Bilinear filtering there takes the four texels around it; all else is black, so that none
    of them may reach beyond the block. Its gutter is not counted on."""
    color, normal = np.zeros((32, 32, 4), np.uint8), np.zeros((32, 32, 3), np.uint8)
    whiten(color, normal, None, np.array([8 + x, 12 + y, WHITE, WHITE]), 0)
    middle = np.array([12 + y, 8 + x]) + WHITE / 2
    for level, image in enumerate([color, next(iter(mip_levels(color, True)))]):
        low = middle / 2**level - 0.5
        around = [
            image[row, column]
            for row in {int(np.floor(low[0])), int(np.ceil(low[0]))}
            for column in {int(np.floor(low[1])), int(np.ceil(low[1]))}
        ]
        assert (np.array(around) == 255).all()


def test_flat_and_line_like_clusters_bake_without_complaint():
    plant = quads([[0, 0, 0]])
    for half_size, half_depth in (((1.0, 1.0), 0.0), ((1.0, 0.0), 0.0), ((0.0, 0.0), 0.0)):
        baked = bake(plant, ZERO, billboards([[0, 0, 0]], half_size, half_depth), 4.0)
        (x, y, w, h), *_ = baked.atlas.front
        picture = np.s_[y : y + h, x : x + w]
        assert (baked.atlas.color[picture][..., 3] == 255).all()
        assert (baked.atlas.depth[picture] == 32768).all()


def test_density_is_lowered_to_fit_the_largest_texture():
    packing, density = fit(np.full((50, 2), 1.0), 20.0, 2, 64)
    assert max(packing.width, packing.height) <= 64
    assert 1 < density < 20
    wide, _ = fit(np.array([[1021.0, 1.0]]), 1.0, 2, 2046)  # 2046 texels, in blocks of four 2048
    assert wide.width <= 2046
    with pytest.raises(UsageError, match="max-texture"):
        fit(np.full((200, 2), 1.0), 20.0, 2, 64)


def test_a_white_block_counts_where_the_texture_is_small():
    packing, density = fit(np.full((50, 2), 1.0), 20.0, 2, 64, blocks=1)
    assert len(packing.rect) == 51
    assert packing.rect[-1, 2:].tolist() == [WHITE, WHITE]
    assert max(packing.width, packing.height) <= 64
    assert 1 < density < 20
    with pytest.raises(UsageError, match="max-texture"):
        fit(np.full((200, 2), 1.0), 20.0, 2, 64, blocks=1)


def test_inputs_are_left_as_they_were():
    plant = leafy(np.random.default_rng(6), 20)
    labels = np.zeros(20, dtype=np.int32)
    before = plant.positions.copy(), plant.materials[1].color_texture.pixels.copy()
    bake(plant, labels, billboards([[0, 0, 0]], 1.5, 1.5), 8.0)
    assert (plant.positions == before[0]).all()
    assert (plant.materials[1].color_texture.pixels == before[1]).all()
    assert isinstance(plant, Plant) and not labels.any()


def test_sources_much_finer_than_the_samples_keep_their_mean(alpha_as_baked):
    """A fine cut-out texture, seen 16 texels to a sample, still covers what it covers."""
    rng = np.random.default_rng(7)
    image = np.full((512, 512, 4), [90, 140, 60, 255], dtype=np.uint8)
    image[..., 3] = 255 * (rng.random((512, 512)) < 0.3)
    leaf = Material("m", color_texture=texture(image), alpha_mode="mask", double_sided=True)
    plant = quads([[0, 0, 0]], materials=(leaf,))
    with PlantBuffers(plant) as buffers:
        assert buffers.texels_per_metre == pytest.approx([256])
        baked = bake(buffers, ZERO, billboards([[0, 0, 0]], 1.0), 4.0, BakeOptions(supersample=4))
    color, _, _ = cut(baked.atlas)
    assert color[..., 3].mean() / 255 == pytest.approx(0.3, abs=0.03)
    assert np.abs(color[color[..., 3] > 0][:, :3] - [90, 140, 60]).max() <= 1


@pytest.mark.parametrize("texels_per_metre", [1e5, 1e12])
def test_a_density_far_beyond_the_texture_is_lowered_to_what_fits(texels_per_metre: float) -> None:
    """The longest side takes all that there is, whatever was asked for."""
    packing, density = fit(np.array([[1.0, 1e-6]]), texels_per_metre, 2, 1024)
    assert packing.width == 1024
    assert density == pytest.approx(1020 / 2)
