"""Levels as a client draws them: corners, sides, texture coordinates and tangent frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vegtool.formats.tangents import tangents
from vegtool.lod import Atlas, Billboards, Display, Level, billboard_quads

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
    with pytest.raises(ValueError, match="one rectangle per billboard"):
        replace(made, atlas=replace(made.atlas, front=FRONT[:1], back=FRONT[:1]))
