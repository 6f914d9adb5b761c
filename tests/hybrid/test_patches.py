"""Planes that patch cracks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plants import plant_of

from vegtool.arrays import FloatArray
from vegtool.clustering.plane_cover import Cover, even_hemisphere
from vegtool.hybrid.cloud import Cloud, cloud_of
from vegtool.hybrid.patches import Missing, patched
from vegtool.hybrid.sights import sights
from vegtool.plant import Plant
from vegtool.refine.hits import Rays

SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)
"""Two triangles, seen from +z."""


def prism(sides: int) -> Plant:
    """The wall of a column of radius 1, seen from outside."""
    turn = 2 * np.pi * np.arange(sides + 1) / sides
    ring = np.stack([np.cos(turn), np.zeros(sides + 1), np.sin(turn)], axis=1)
    low, high = ring, ring + np.array([0.0, 1.0, 0.0])
    a, b, c, d = low[:-1], high[:-1], high[1:], low[1:]
    corners = np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1).reshape(-1, 3, 3)
    return plant_of(corners, double_sided=False)


def eighths(plant: Plant) -> Cloud:
    """A prism on eight planes, each through an eighth of it, which may move faces farther than
    these."""
    middle = plant.face_centroids
    turn = np.arctan2(middle[:, 2], middle[:, 0]) / (2 * np.pi)
    eighth = np.floor(8 * turn + 0.5 + 1e-6).astype(np.int32) % 8
    order = np.argsort(eighth, kind="stable").astype(np.int32)
    turns = np.arange(8) * np.pi / 4
    normal = np.stack([np.cos(turns), np.zeros(8), np.sin(turns)], axis=1)
    cloud = Cloud(plant, order, eighth[order], normal, 1.0)
    return replace(cloud, reach=2.5 * float(np.abs(cloud.heights()).max()))


def pictures(cloud: Cloud) -> FloatArray:
    """(q, 3, 3) radii about the centre."""
    plant, normal = cloud.plant, cloud.normal[cloud.plane]
    corners = (plant.corners[cloud.face] - plant.center) / plant.radius
    return np.asarray(corners - cloud.heights()[..., None] * normal[:, None])


def holes(cloud: Cloud, views: FloatArray, cells: int = 24) -> float:
    """The plain way: rays one by one, on all faces and all pictures; the share of those that meet
    the front of a face, and of no picture."""
    plant, flat = cloud.plant, pictures(cloud)
    corners = (plant.corners - plant.center) / plant.radius
    met = missed = 0
    for view in views:
        right = np.cross([0.3, 1.0, 0.2], view)
        right /= np.linalg.norm(right)
        up = np.cross(view, right)
        for x in np.linspace(-1, 1, cells):
            for y in np.linspace(-1, 1, cells):
                origin = x * right + y * up
                if front_met(corners, origin, view):
                    met += 1
                    missed += not front_met(flat, origin, view)
    return missed / met


def front_met(triangles: FloatArray, origin: FloatArray, view: FloatArray) -> bool:
    """Whether a line towards a viewer passes triangles whose corners it sees turn to the left."""
    a, b, c = (triangles - origin).swapaxes(0, 1)
    sides = [np.cross(p, q) @ view for p, q in ((a, b), (b, c), (c, a))]
    return bool((np.min(sides, axis=0) > 0).any())


def test_one_sided_faces_are_seen_from_the_front_alone() -> None:
    # What is seen of a square looks as large as its projection, but for the rays along its edge.
    both = np.zeros(2, dtype=bool)
    looked = sights(SQUARE, both, np.ones(2, dtype=bool), 0.0)
    seen = looked.seen(np.ones(len(looked.first), dtype=bool), 2).sum(axis=1)
    facing = looked.rays.views[:, 2]
    shown = looked.seen(np.ones(len(looked.first), dtype=bool), 2).sum(axis=0)
    assert shown == pytest.approx(np.maximum(facing, 0.0), abs=0.03)
    assert seen[0] == pytest.approx(seen[1], rel=0.05)
    from_both = sights(SQUARE, ~both, np.ones(2, dtype=bool), 0.0)
    shown = from_both.seen(np.ones(len(looked.first), dtype=bool), 2).sum(axis=0)
    assert shown == pytest.approx(np.abs(facing), abs=0.03)


def test_a_picture_of_the_other_side_shows_nothing() -> None:
    # Behind the front square lies another that looks the other way: rays pass the first.
    away = SQUARE[:, ::-1] - [0, 0, 0.5]
    corners, both = np.concatenate([SQUARE, away]), np.ones(4, dtype=bool)
    looked = sights(corners, both, both, 0.0)
    before = (looked.first >= 0) & (looked.first < 2) & looked.front
    ray, _ = looked.met(away, both[:2])
    assert before.any() and not before[ray].any()


def test_what_pictures_show_of_what_is_missing() -> None:
    # The plain way: face by face and view by view.
    rng = np.random.default_rng(3)
    corners = rng.normal(size=(5, 3, 3))
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    views = np.concatenate([even_hemisphere(4), -even_hemisphere(4)])
    missing = rng.uniform(0, 1, (5, 8))
    pieces = Missing(corners.swapaxes(0, 1), np.arange(5), area, np.zeros(5), views, missing)
    planes = even_hemisphere(3)
    for found, normal in zip(pieces.projected(planes), planes, strict=True):
        for face in range(5):
            worth = 0.0
            for nth, view in enumerate(views):
                picture = (area[face] @ normal) * (normal @ view)
                if (picture > 0) == (area[face] @ view > 0):  # the side that is seen
                    worth += min(abs(picture), missing[face, nth])
            assert found[face] == pytest.approx(worth, abs=1e-9)
    few = pieces.of(np.array([1, 4]))
    assert np.array_equal(few.projected(planes), pieces.projected(planes)[:, [1, 4]])


def test_a_plane_of_its_own_shows_all_that_is_seen_of_a_face() -> None:
    views = even_hemisphere(6)
    area = np.array([[0, 0, 0.5]])
    missing = np.maximum(views @ area.T, 0.0).T
    pieces = Missing(SQUARE[:1].swapaxes(0, 1), np.arange(1), area, np.zeros(1), views, missing)
    assert pieces.projected(np.array([[0, 0, 1.0]]))[0, 0] == pytest.approx(missing.sum())


def test_patches_close_the_cracks_between_planes() -> None:
    # Eighths of a column moved onto planes through the middle of their depth part where they met:
    # the planes cut each other farther out. Faces beyond are valid for both, and close that.
    cloud = eighths(prism(192))
    beside, more = patched(cloud, 0), patched(cloud, 2)
    own = {(f, k) for f, k in zip(cloud.face.tolist(), cloud.plane.tolist(), strict=True)}
    for made, planes in ((beside, 8), (more, 10)):
        pairs = set(zip(made.face.tolist(), made.plane.tolist(), strict=True))
        assert own <= pairs and len(pairs) == len(made.face)
        assert 8 <= len(made.normal) <= planes
        assert np.array_equal(np.unique(made.plane), np.arange(len(made.normal)))
        assert (np.diff(made.plane) >= 0).all()
        assert np.linalg.norm(made.normal, axis=1) == pytest.approx(1.0)
        assert np.abs(made.heights()).max() <= cloud.reach + 1e-6
    turns = (np.arange(8) + 0.5) * np.pi / 4
    at_cracks = np.stack([np.cos(turns), np.zeros(8), np.sin(turns)], axis=1)
    axis = np.zeros(3)
    for view in at_cracks:
        assert not front_met(pictures(cloud), axis, view)
        assert front_met(pictures(beside), axis, view)
    # What stays is the outline: all is drawn on planes that lie within the column.
    views = Rays.around(SQUARE, 5).views
    without, with_beside, with_more = (holes(one, views) for one in (cloud, beside, more))
    assert with_more < with_beside < 0.7 * without
    assert len(beside.normal) == 8


def test_the_same_cloud_gets_the_same_patches() -> None:
    cloud = eighths(prism(12))
    one, other = patched(cloud, 1), patched(cloud, 1)
    assert np.array_equal(one.face, other.face)
    assert np.array_equal(one.plane, other.plane)
    assert np.array_equal(one.normal, other.normal)


def test_where_nothing_is_missing_nothing_is_added() -> None:
    # A square on its own plane is shown to all who see it.
    plant = plant_of(SQUARE)
    cloud = Cloud(
        plant, np.arange(2, dtype=np.int32), np.zeros(2, np.int32), np.array([[0, 0, 1.0]]), 0.0
    )
    made = patched(cloud, 3)
    assert len(made.normal) == 1
    assert np.array_equal(made.face, cloud.face)


def test_what_alpha_cuts_out_is_left_as_it_is() -> None:
    cloud = eighths(prism(12))
    leaf = replace(cloud.plant.materials[0], alpha_mode="mask")
    cut_out = replace(cloud, plant=replace(cloud.plant, materials=(leaf,)))
    assert patched(cut_out, 2) is cut_out


def test_a_point_is_left_as_it_is() -> None:
    plant = plant_of(np.ones((1, 3, 3)))
    one = np.zeros(1, np.int32)
    cloud = Cloud(plant, one, one, np.array([[0, 0, 1.0]]), 0.0)
    assert patched(cloud, 1) is cloud


def test_planes_that_are_left_without_faces_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    # Of very many faces planes are sought for some; all of a plane's may have gone to those before.
    square = np.zeros(1, dtype=np.int64)
    found = Cover(square + 1, np.eye(3)[1:], np.zeros(2))
    monkeypatch.setattr("vegtool.hybrid.cloud.planes_for", lambda *_: found)
    cloud = cloud_of(plant_of(SQUARE), 2)
    assert cloud.plane.tolist() == [0, 0]
    assert len(cloud.normal) == len(cloud.billboards()) == 1


def test_billboards_lie_halfway_between_their_faces() -> None:
    # On the mean, most faces of an eighth would lie before their plane: it is bent outward.
    cloud = eighths(prism(24))
    plant, made = cloud.plant, cloud.billboards()
    reach = cloud.reach * plant.radius
    for plane in range(8):
        faces = plant.corners[cloud.face[cloud.plane == plane]]
        height = (faces - made.center[plane]) @ cloud.normal[plane]
        assert height.max() == pytest.approx(-height.min())
        assert height.max() <= reach + 1e-9
        assert made.half_depth[plane] >= height.max() - 1e-9
