"""Welding and connected parts."""

from __future__ import annotations

import numpy as np
from branch_cases import tube

from vegtool.branches.parts import WELD, connected_parts, weld


def test_weld_joins_what_is_closer_than_half_a_step_and_nothing_farther_than_two():
    rng = np.random.default_rng(0)
    places = rng.uniform(-1, 1, (200, 3))
    copies = np.repeat(places, 3, axis=0)
    noisy = np.clip(copies + rng.uniform(-0.01, 0.01, copies.shape) * WELD, -1, 1)
    labels = weld(noisy)
    same = labels[:, None] == labels
    distance = np.abs(noisy[:, None] - noisy).max(axis=2)
    assert not same[distance > 2 * WELD].any()
    assert same[distance < WELD / 4].mean() > 0.999  # two grids miss a place at a border of both
    exact = weld(copies)
    assert np.array_equal(exact[:, None] == exact, (copies[:, None] == copies).all(axis=2))


def test_a_seam_is_welded_within_a_part_and_touching_parts_stay_apart():
    """Two tubes that share a ring by position, not by index."""
    (a, fa), (b, fb) = tube((0, 0, 0), (0, 0.5, 0)), tube((0, 0.5, 0), (0, 0.9, 0), (0.05, 0.02))
    parts = connected_parts(np.concatenate([a, b]), np.concatenate([fa, fb + len(a)]))
    assert parts.count == 2
    assert len(parts.positions) == 2 * 4 * 6  # rings of six, not of seven
    assert parts.face_part.tolist() == [0] * 36 + [1] * 36
    assert np.array_equal(parts.vertex_part[parts.faces[:, 0]], parts.face_part)


def test_a_tube_cut_along_its_rings_is_one_part():
    """As exporters write it that split vertices where tangents change: bands of twelve faces."""
    vertices, faces = tube((0, 0, 0), (0, 0.5, 0))
    bands = faces.reshape(-1, 12, 3)
    assert len(bands) > 2
    corners, cut = [], []
    for band in bands:
        own, index = np.unique(band, return_inverse=True)
        cut.append(index.reshape(-1, 3) + sum(map(len, corners)))
        corners.append(vertices[own])
    apart = connected_parts(np.concatenate(corners), np.concatenate(cut))
    assert apart.count == 1
    assert len(apart.positions) == connected_parts(vertices, faces).vertex_part.size


def test_vertices_are_numbered_as_the_faces_show_them():
    vertices, faces = tube((0, 0, 0), (0, 0.5, 0))
    parts = connected_parts(vertices, faces[::-1])
    _, first = np.unique(parts.faces, return_index=True)
    assert (np.diff(first) > 0).all()


def test_in_a_soup_the_order_of_the_file_parts_what_touches():
    """First tube, one elsewhere, then one that starts on the first one's last ring."""
    tubes = [
        tube((0, 0, 0), (0, 0.5, 0)),
        tube((0.5, 0, 0), (0.5, 0.5, 0)),
        tube((0, 0.5, 0), (0, 0.9, 0), (0.05, 0.02)),
    ]
    corners = np.concatenate([v[f].reshape(-1, 3) for v, f in tubes])
    faces = np.arange(len(corners)).reshape(-1, 3)
    assert connected_parts(corners, faces).face_part.tolist() == [0] * 36 + [1] * 36 + [2] * 36
    order = np.random.default_rng(0).permutation(len(faces))
    mixed = connected_parts(corners, faces[order])
    assert mixed.count == 2  # the order says nothing now: what touches is one
