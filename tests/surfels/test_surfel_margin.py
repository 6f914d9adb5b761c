"""What a billboard shows beyond its own: connected with it, within its margin, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from surfel_cases import surface

from vegtool.arrays import IntArray
from vegtool.growth import sample
from vegtool.lod import Billboards
from vegtool.plant import Plant
from vegtool.surfels.box import boxes_of
from vegtool.surfels.margin import going_on, welded, with_margin


def ribbon(count: int, seams: bool = False) -> Plant:
    """Squares of a metre in a row along x, two triangles each; with seams, each has its own
    vertices."""
    x = np.arange(count + 1, dtype=float)
    points = np.stack([np.repeat(x, 2), np.tile([0.0, 1.0], count + 1), np.zeros(2 * count + 2)], 1)
    square = np.array([[0, 2, 3], [0, 3, 1]])
    faces = (2 * np.arange(count)[:, None, None] + square).reshape(-1, 3)
    if seams:
        points, faces = points[faces.ravel()], np.arange(faces.size).reshape(-1, 3)
    return surface(points, faces)


def about(plant: Plant, own: IntArray, margin: float) -> Billboards:
    boxes = boxes_of(plant.corners[own], np.array([0]))
    return with_margin(boxes, np.full(1, margin))


@pytest.mark.parametrize("seams", [False, True])
def test_the_next_triangles_go_on_and_no_others(seams: bool) -> None:
    """The middle square's box reaches a quarter into its neighbours: those touch it, and no vertex
    of theirs further out lies in it."""
    plant, own = ribbon(7, seams), np.array([6, 7], dtype=np.int32)
    planes = about(plant, own, 0.25)
    face, by = going_on(plant, own, np.zeros(2, np.int32), planes, planes.half_depth)
    assert not set(face) & {6, 7} and set(by) == {0}
    assert set(face) == {4, 5, 8, 9}, "all that share one of the square's four corners"


def test_what_only_lies_near_is_not_shown() -> None:
    one, other = ribbon(1), ribbon(1)
    apart = other.positions + np.array([1.05, 0, 0])
    plant = surface(
        np.concatenate([one.positions, apart]), np.concatenate([one.faces, 4 + other.faces])
    )
    own = np.array([0, 1], dtype=np.int32)
    planes = about(plant, own, 0.5)
    face, _ = going_on(plant, own, np.zeros(2, np.int32), planes, planes.half_depth)
    assert len(face) == 0


def test_whatever_shares_a_vertex_within_the_box_is_found() -> None:
    """A slow search over all pairs of faces finds the same."""
    plant = sample("statue", 1500)
    rng = np.random.default_rng(0)
    seeds = rng.choice(len(plant.faces), 6, replace=False)
    near = np.linalg.norm(plant.face_centroids[:, None] - plant.face_centroids[seeds], axis=2)
    faces = [np.flatnonzero(near[:, i] < 0.1 * plant.radius) for i in range(6)]
    own, by = np.concatenate(faces), np.repeat(np.arange(6), [len(one) for one in faces])
    first = np.cumsum([0, *(len(one) for one in faces)])[:-1]
    boxes = boxes_of(plant.corners[own], first)
    planes = with_margin(boxes, np.full(6, 0.05 * plant.radius))
    found = going_on(plant, own.astype(np.int32), by.astype(np.int32), planes, planes.half_depth)

    vertices = welded(plant)
    expected = set()
    for billboard, shown in enumerate(faces):
        reach = np.array([*planes.half_size[billboard], planes.half_depth[billboard]])
        axes = np.stack([planes.u, planes.v, planes.normal], axis=1)[billboard]
        inside = (np.abs((plant.corners - planes.center[billboard]) @ axes.T) <= reach).all(axis=2)
        have = set(shown.tolist())
        while True:
            touched = set(vertices[sorted(have)][inside[sorted(have)]].tolist())
            more = {f for f in range(len(vertices)) if set(vertices[f].tolist()) & touched} - have
            if not more:
                break
            have |= more
        expected |= {(face, billboard) for face in have - set(shown.tolist())}
    assert set(zip(found[0].tolist(), found[1].tolist(), strict=True)) == expected
    assert len(found[0]) == len(expected), "each once"
