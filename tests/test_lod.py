"""Levels as a client draws them: corners, sides, texture coordinates and tangent frames."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from vegtool.lod import Atlas, Billboards, Display, Level, billboard_quads, level_triangles
from vegtool.plant import Material, Plant
from vegtool.tangents import tangents

FRONT = np.array([[2, 3, 10, 6], [20, 3, 5, 12]])
BACK = np.array([[2, 20, 10, 6], [30, 20, 5, 12]])


def level(double_sided: bool) -> Level:
    """Two billboards, turned at random, on an atlas of 40 x 32 texels."""
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(2, 3, 3)))[0]
    billboards = Billboards(
        center=np.array([[0, 5, 0], [3, 2, 1]]),
        u=turn[:, 0],
        v=turn[:, 1],
        half_size=np.array([[2.0, 1.0], [0.5, 1.5]]),
        half_depth=np.zeros(2),
        cluster=np.arange(2),
    )
    atlas = Atlas(
        np.zeros((32, 40, 4)), np.zeros((32, 40, 3)), np.zeros((32, 40)), FRONT,
        FRONT if double_sided else BACK,
    )  # fmt: skip
    return Level("billboards", billboards=billboards, atlas=atlas, double_sided=double_sided)


@pytest.mark.parametrize("double_sided", [True, False])
def test_quads_face_where_their_normals_point(double_sided: bool) -> None:
    made = level(double_sided)
    quads = billboard_quads(made)
    faces = quads.indices.reshape(-1, 3)
    assert len(faces) == made.triangles == (4 if double_sided else 8)
    a, b, c = (quads.positions[faces[:, k]] for k in range(3))
    area = np.cross(b - a, c - a) / 2
    facing = np.einsum("fi,fi->f", area, quads.normals[faces[:, 0]])
    assert facing == pytest.approx([4, 4, 1.5, 1.5] * (len(faces) // 4))
    assert made.billboards is not None
    both = np.concatenate([made.billboards.normal, -made.billboards.normal])
    assert quads.normals[::4] == pytest.approx(both[: len(quads.normals) // 4])


@pytest.mark.parametrize("double_sided", [True, False])
def test_tangent_frames_are_those_of_the_texture_coordinates(double_sided: bool) -> None:
    """The oracle takes them from positions and texture coordinates, as for any mesh."""
    quads = billboard_quads(level(double_sided))
    faces = quads.indices.reshape(-1, 3)
    expected, origin, _ = tangents(quads.positions, quads.normals, quads.uvs, faces)
    assert origin.tolist() == list(range(len(quads.positions)))  # no vertex had to be split
    assert quads.tangents == pytest.approx(expected)
    bitangent = np.cross(quads.normals, quads.tangents[:, :3]) * quads.tangents[:, 3:]
    v = level(double_sided).billboards.v
    assert bitangent[::4] == pytest.approx(np.tile(v, (len(bitangent) // 8, 1)))


def test_both_pictures_have_their_left_edge_at_minus_u_and_their_top_at_plus_v() -> None:
    made = level(double_sided=False)
    quads, boards = billboard_quads(made), made.billboards
    for index, (x, y, w, h) in enumerate([*FRONT, *BACK]):
        corners = slice(4 * index, 4 * index + 4)
        board = index % 2
        local = quads.positions[corners] - boards.center[board]
        right = local @ boards.u[board] / boards.half_size[board, 0]
        up = local @ boards.v[board] / boards.half_size[board, 1]
        texel = quads.uvs[corners] * [40, 32]
        assert texel[:, 0] == pytest.approx(x + w * (1 + right) / 2)
        assert texel[:, 1] == pytest.approx(y + h * (1 - up) / 2)


def wood() -> Plant:
    """A tetrahedron of two single-sided faces and two double-sided ones, each with vertices that
    the others use too, and a vertex that nothing uses."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [9, 9, 9.0]])
    normals = np.array([[0, 1, 0], [0, 0, 1], [0.6, 0, 0.8], [-1, 0, 0], [1, 0, 0.0]])
    colors = np.tile([0.4, 0.2, 0.1, 0.5], (5, 1)) * np.array([[1], [0.5], [2], [3], [1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    materials = (Material("bark"), Material("r", base_color=[0.5, 1, 2, 1], double_sided=True))
    uvs = np.zeros((5, 2))
    return Plant("w", corners, normals, uvs, faces, [0, 1, 1, 0], materials, colors=colors)


def hybrid(double_sided: bool) -> Level:
    made = level(double_sided)
    assert made.atlas is not None
    atlas = replace(made.atlas, white=np.array([34, 2, 4, 6]))
    return replace(made, kind="hybrid", mesh=wood(), atlas=atlas)


@pytest.mark.parametrize("double_sided", [True, False])
def test_a_hybrid_is_its_quads_and_its_mesh(double_sided: bool) -> None:
    """Where the client culls, the two double-sided faces are there twice, in opposite order and
    with opposite normals: then any eye sees one of them, lit from its side."""
    made = hybrid(double_sided)
    drawn, quads = level_triangles(made), billboard_quads(level(double_sided))
    n, m = len(quads.positions), len(quads.indices)
    for name in ("positions", "normals", "tangents", "uvs"):
        np.testing.assert_array_equal(getattr(drawn, name)[:n], getattr(quads, name))
    np.testing.assert_array_equal(drawn.indices[:m], quads.indices)
    assert drawn.colors is not None
    assert (drawn.colors[:n] == 1).all()

    assert made.mesh is not None
    mesh, faces = made.mesh, drawn.indices[m:].reshape(-1, 3)
    order = [0, 3, 1, 2]  # by material
    corners = mesh.corners[order]
    expected = corners if double_sided else np.concatenate([corners, corners[2:][::-1, ::-1]])
    np.testing.assert_array_equal(drawn.positions[faces], expected)
    normals = mesh.normals[mesh.faces[order]]
    np.testing.assert_array_equal(drawn.normals[faces[:4]], normals)
    np.testing.assert_array_equal(
        drawn.normals[faces[4:]], -normals[2:][: len(faces) - 4, ::-1][::-1]
    )
    assert made.mesh_triangles == len(faces) == (4 if double_sided else 6)
    assert made.triangles == len(drawn.indices) // 3
    assert made.texels == level(double_sided).texels
    assert 9 not in drawn.positions, "a vertex of no face is not drawn"


@pytest.mark.parametrize("double_sided", [True, False])
def test_a_hybrids_mesh_shows_one_place_and_has_the_colours(double_sided: bool) -> None:
    """The middle of the block is at 36 of 40 texels across and 5 of 32 down. Factors of material
    and vertex multiply, and cannot exceed what a file holds; the mesh is opaque."""
    made = hybrid(double_sided)
    drawn, quads = level_triangles(made), 4 * len(billboard_quads(made).positions) // 4
    np.testing.assert_array_equal(np.unique(drawn.uvs[quads:], axis=0), [[36 / 40, 5 / 32]])
    tangents, normals = drawn.tangents[quads:], drawn.normals[quads:]
    assert np.einsum("vi,vi->v", tangents[:, :3], normals) == pytest.approx(0, abs=1e-12)
    assert np.linalg.norm(tangents[:, :3], axis=1) == pytest.approx(1)
    assert (tangents[:, 3] == 1).all()
    assert made.mesh is not None and made.mesh.colors is not None and drawn.colors is not None
    faces = drawn.indices.reshape(-1, 3)[-made.mesh_triangles :]
    for face, corner in product(range(2), range(3)):
        own = made.mesh.colors[made.mesh.faces[[0, 3][face], corner], :3]
        assert drawn.colors[faces[face, corner]] == pytest.approx([*np.minimum(own, 1), 1])
        own = made.mesh.colors[made.mesh.faces[[1, 2][face], corner], :3] * [0.5, 1, 2]
        assert drawn.colors[faces[2 + face, corner]] == pytest.approx([*np.minimum(own, 1), 1])


def test_a_mesh_without_normals_still_has_tangents() -> None:
    """A file allows no zero tangent; the normal becomes upright when it is written."""
    made = hybrid(double_sided=True)
    assert made.mesh is not None
    flat = replace(made, mesh=replace(made.mesh, normals=np.zeros((5, 3))))
    lengths = np.linalg.norm(level_triangles(flat).tangents[8:, :3], axis=1)
    assert lengths == pytest.approx(1)


def test_a_display_counts_pixels_there_and_back() -> None:
    """90 degrees: at one metre, two metres fill the image."""
    display = Display(90.0, 1000)
    assert display.pixels_per_metre(1.0) == pytest.approx(500)
    assert display.distance_m(display.pixels_per_metre(7.0)) == pytest.approx(7)


def test_a_level_needs_what_its_kind_draws() -> None:
    made = level(double_sided=True)
    with pytest.raises(ValueError, match="needs its mesh"):
        Level("mesh")
    with pytest.raises(ValueError, match="billboards and an atlas"):
        Level("billboards", billboards=made.billboards)
    mixed = hybrid(double_sided=True)
    assert mixed.mesh is not None and mixed.atlas is not None
    with pytest.raises(ValueError, match="a mesh with colours"):
        replace(mixed, mesh=replace(mixed.mesh, colors=None))
    with pytest.raises(ValueError, match="a white block"):
        replace(mixed, atlas=made.atlas)
    cut_out = (Material("bark"), Material("leaf", alpha_mode="mask"))
    with pytest.raises(ValueError, match="leaf of a hybrid must be opaque"):
        replace(mixed, mesh=replace(mixed.mesh, materials=cut_out))
    with pytest.raises(ValueError, match="one rectangle per billboard"):
        replace(made, atlas=replace(made.atlas, front=FRONT[:1], back=FRONT[:1]))
