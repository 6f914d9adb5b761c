"""The graph: what its nodes say of errors and places, and that all levels are the same surface."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest
from surfel_cases import (
    COARSE,
    Border,
    ball,
    both,
    distances,
    hills,
    rounds,
    scattered,
    surface,
)

from vegtool.growth import sample
from vegtool.lod import Display
from vegtool.plant import Plant
from vegtool.surfels import cuts
from vegtool.surfels.multi_triangulation import MultiTriangulation, multi_triangulation


@pytest.fixture(scope="module", params=["hills", "ball", "tree"])
def made(request: pytest.FixtureRequest) -> MultiTriangulation:
    if request.param == "tree":
        return multi_triangulation(sample("dead-tree", 12000), epsilon=4.0)
    return multi_triangulation(hills() if request.param == "hills" else ball(), COARSE)


def rows(faces: np.ndarray, material: np.ndarray) -> list[tuple[int, ...]]:
    """Triangles from their least vertex on, and their materials, sorted."""
    turned = [np.roll(face, -face.argmin()).tolist() for face in faces]
    return sorted((*face, kind) for face, kind in zip(turned, material.tolist(), strict=True))


def test_without_error_it_is_the_original(made: MultiTriangulation) -> None:
    """Every triangle, with its material, and none twice."""
    plant, drawn = made.plant, cuts.drawn(made, cuts.by_error(made, 0.0))
    assert rows(drawn.faces, drawn.face_material) == rows(plant.faces, plant.face_material)
    assert np.array_equal(cuts.by_error(made, 0.0), made.end == 0)


def test_it_is_of_many_levels(made: MultiTriangulation) -> None:
    """Several rounds; and the coarsest level has clearly fewer triangles."""
    assert rounds(made).max() - 1 >= 3
    coarsest = cuts.triangles(made, cuts.coarsest(made))
    assert len(coarsest) < 0.8 * len(made.plant.faces)
    assert np.array_equal(cuts.by_error(made, 1e9), cuts.coarsest(made))


def test_patches_have_about_ten_triangles(made: MultiTriangulation) -> None:
    assert 8 < made.sizes.mean() < 12
    assert made.sizes.max() <= 14


def test_every_node_saves_a_fifth_of_its_triangles(made: MultiTriangulation) -> None:
    nodes = len(made.error)
    takes, makes = (np.bincount(by, made.sizes, nodes) for by in (made.start, made.end))
    assert (makes[1:-1] <= 0.8 * takes[1:-1]).all()
    assert (makes[1:] > 0).sum() == nodes - 2


def test_errors_and_spheres_grow_along_arcs(made: MultiTriangulation) -> None:
    """And a sphere holds all vertices of what the node takes and makes."""
    assert (made.error[made.start] >= made.error[made.end]).all()
    assert (made.error[1:] > 0).all()
    inner = made.end > 0
    above, below = made.start[inner], made.end[inner]
    apart = np.linalg.norm(made.center[above] - made.center[below], axis=1)
    assert (apart + made.radius[below] <= made.radius[above] * (1 + 1e-9)).all()
    corners = made.plant.positions[made.faces]
    for nodes, arcs in ((made.start, made.start > 0), (made.end, made.end > 0)):
        node = np.repeat(nodes, made.sizes)
        face = np.repeat(arcs, made.sizes)
        away = np.linalg.norm(corners[face] - made.center[node[face], None], axis=2)
        assert (away <= made.radius[node[face], None] * (1 + 1e-9)).all()


def test_it_ends_where_billboards_begin() -> None:
    """No node is for distances beyond two mean sides of the bounds; a smaller picture, or more
    displacement allowed, goes further up."""
    plant = ball(4)
    side = float((plant.bounds[1] - plant.bounds[0]).mean())
    left = []
    for display, epsilon in ((Display(image_height_px=400), 1.0), (COARSE, 1.0), (COARSE, 3.0)):
        made = multi_triangulation(plant, display, epsilon)
        z_min = cuts.z_min(made, display.pixels_per_metre(1.0), epsilon)
        assert (z_min[:-1] <= 2 * side * (1 + 1e-12)).all()
        left.append(len(cuts.triangles(made, cuts.coarsest(made))))
    assert left[0] > left[1] > left[2]


@pytest.mark.parametrize("quantile", [0.1, 0.4, 0.7, 1.0])
def test_no_point_of_the_original_is_further_than_the_error(
    made: MultiTriangulation, quantile: float
) -> None:
    """Random points, not those that were measured. And it is no idle bound: at most three times
    what the worst of few points shows."""
    delta = float(np.quantile(made.error[1:-1], quantile))
    corners = made.plant.positions[made.faces[cuts.triangles(made, cuts.by_error(made, delta))]]
    off = distances(scattered(made.plant, made.plant.faces, 500), corners)
    assert off.max() <= delta
    if quantile == 1.0:
        assert off.max() > delta / 3


def test_nor_does_the_coarsest_level_lead_away_from_the_original(made: MultiTriangulation) -> None:
    """No chord spans the bends of a twig, though the twig's other side is near all of it."""
    drawn = made.faces[cuts.triangles(made, cuts.coarsest(made))]
    off = distances(scattered(made.plant, drawn, 500), made.plant.corners)
    assert off.max() <= made.error[:-1].max()


def test_same_input_same_bytes() -> None:
    one, two = (multi_triangulation(hills(30), COARSE) for _ in range(2))
    assert as_bytes(one) == as_bytes(two)


def as_bytes(made: MultiTriangulation) -> list[bytes]:
    return [getattr(made, f.name).tobytes() for f in fields(made) if f.name != "plant"]


def test_moved_and_scaled() -> None:
    """Places that floats hold exactly, moved by whole numbers and made 4 times as large: the same
    graph to the bit, with errors 4 times as large."""
    plant = hills(30)
    plant = replace(plant, positions=np.round(plant.positions * 2**20) / 2**20)
    shift = np.array([3.0, -5.0, 8.0])
    there = replace(plant, positions=4 * plant.positions + shift, uvs=plant.uvs)
    one, two = (multi_triangulation(p, COARSE) for p in (plant, there))
    for name in ("faces", "first", "material", "start", "end"):
        assert np.array_equal(getattr(one, name), getattr(two, name))
    assert np.array_equal(4 * one.error, two.error)
    assert np.array_equal(4 * one.radius, two.radius)
    np.testing.assert_allclose(4 * one.center[1:] + shift, two.center[1:], atol=1e-12)


def test_turned() -> None:
    """Rounding decides between equals, so that the graph is another; but it is as good."""
    plant = ball()
    angle = np.radians(30)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    there = replace(plant, positions=plant.positions @ turn.T)
    left = []
    for p in (plant, there):
        made = multi_triangulation(p, COARSE)
        left.append([len(cuts.triangles(made, cuts.by_error(made, d))) for d in (0.01, 0.02, 1)])
    np.testing.assert_allclose(left[0], left[1], rtol=0.15)


def test_textures_are_not_torn() -> None:
    """A ball in two islands of its texture, and two materials: no triangle of any level has corners
    of both, and each island keeps its area."""
    plant = ball()
    upper = plant.positions[plant.faces].mean(axis=1)[:, 1] > 0
    count = len(plant.positions)
    two = surface(
        np.tile(plant.positions, (2, 1)),
        plant.faces + count * upper[:, None],
        upper,
        np.concatenate([plant.uvs, plant.uvs + np.array([5.0, 0.0])]),
    )
    made = multi_triangulation(two, COARSE)
    drawn = cuts.drawn(made, cuts.coarsest(made))
    island = drawn.faces >= count
    assert (island == island[:, :1]).all()
    assert np.array_equal(island[:, 0], drawn.face_material == 1)
    for kind in range(2):
        before, after = (p.face_areas[p.face_material == kind].sum() for p in (two, drawn))
        assert after == pytest.approx(before, rel=0.05)
    Border(two).assert_kept(drawn.faces)
    seam = np.abs(plant.positions[:, 1]) < 1e-9
    used = np.unique(drawn.faces % count)
    assert seam[used].sum() < 0.7 * seam.sum()  # vertices on the seam go as well


def test_creases_are_simplified() -> None:
    """A ball of flat triangles, each with vertices and normals of its own, becomes as few triangles
    as a smooth one; and of the normals at a place, corners take such as fit their triangle."""
    plant = ball()
    corners = plant.positions[plant.faces].reshape(-1, 3)
    normal = plant.face_area_vectors / plant.face_areas[:, None]
    index = np.arange(len(corners)).reshape(-1, 3)
    flat = surface(corners, index, normals=np.repeat(normal, 3, axis=0))
    levels = [multi_triangulation(p, COARSE) for p in (plant, flat)]
    smooth, creased = (cuts.drawn(made, cuts.coarsest(made)) for made in levels)
    assert len(creased.faces) == pytest.approx(len(smooth.faces), rel=0.1)
    facing = np.einsum("fci,fi->fc", creased.normals[creased.faces], creased.face_area_vectors)
    facing /= creased.face_areas[:, None]
    assert facing.mean() > 0.975
    assert (facing > 0.5).all()


def strip(places: list[tuple[float, float, float]]) -> Plant:
    """Triangles between neighbours of a row of places."""
    n = len(places) - 2
    return surface(places, np.stack([np.arange(n), np.arange(n) + 1, np.arange(n) + 2], axis=1))


def touching() -> Plant:
    """Two balls with one place in common."""
    one = ball(3, 0.0)
    return both(one, ball(3, 0.0, (2, 0, 0)))


def fin() -> Plant:
    """A blade that stands on the middle line of a meadow: three triangles to each edge there."""
    meadow, blade = hills(20, 0.02), hills(20, 0.02)
    x, _, z = blade.positions.T
    line = meadow.positions[20 * 21 // 2 : 20 * 21 // 2 + 21]
    up = np.stack([np.tile(line[:, 0], 21), np.repeat(line[:, 1], 1)[np.rint(x * 20).astype(int)]
                   + z, np.full(441, line[0, 2])], axis=1)  # fmt: skip
    return both(meadow, replace(blade, positions=up))


def twice() -> Plant:
    """Every triangle two times, of the same vertices."""
    plant = hills(12)
    return replace(
        plant, faces=np.repeat(plant.faces, 2, axis=0),
        face_material=np.repeat(plant.face_material, 2),
    )  # fmt: skip


def soup() -> Plant:
    corners = np.random.default_rng(0).normal(size=(200, 1, 3)) + np.random.default_rng(1).normal(
        scale=0.1, size=(200, 3, 3)
    )
    return surface(corners.reshape(-1, 3), np.arange(600).reshape(-1, 3))


def with_lines() -> Plant:
    """Hills among whose triangles are points and lines, and one gap that a line fills."""
    plant = hills(20)
    lines = plant.faces[:40].copy()
    lines[:20, 2] = lines[:20, 1]
    lines[20:] = lines[20:, :1]
    return replace(
        plant, faces=np.concatenate([plant.faces[:400], lines, plant.faces[400:]]),
        face_material=np.zeros(840, np.int32),
    )  # fmt: skip


EXTREMES = {
    "triangle": lambda: strip([(0, 0, 0), (1, 0, 0), (0, 0, 1)]),
    "point": lambda: surface(np.zeros((3, 3)), [[0, 1, 2]]),
    "line": lambda: strip([(i, 0, 0) for i in range(40)]),
    "plane": lambda: hills(20, 0.0),
    "ball": lambda: ball(3),
    "touching": touching,
    "fin": fin,
    "twice": twice,
    "soup": soup,
    "lines": with_lines,
    "tiny": lambda: replace(hills(12), positions=hills(12).positions * 1e-9),
    "far": lambda: replace(hills(30), positions=hills(30).positions + 1e8),
}


@pytest.mark.parametrize("name", EXTREMES)
def test_extremes(name: str) -> None:
    plant = EXTREMES[name]()
    made = multi_triangulation(plant, COARSE)
    drawn = cuts.drawn(made, cuts.by_error(made, 0.0))
    assert rows(drawn.faces, drawn.face_material) == rows(plant.faces, plant.face_material)
    levels = [*np.unique(made.error[:-1])[:: max(1, len(made.error) // 10)], np.inf]
    left, border = [], Border(plant)
    for delta in levels:
        faces = made.faces[cuts.triangles(made, cuts.by_error(made, delta))]
        border.assert_kept(faces)
        left.append(len(faces))
    assert all(b <= a for a, b in pairwise(left))
    if name in ("plane", "ball", "touching", "fin", "lines", "tiny"):
        assert left[-1] < 0.7 * left[0]
    else:
        assert name == "far" or left[-1] == left[0]


def test_a_plane_costs_nothing() -> None:
    """Its inner vertices go without any error but that which says that they went."""
    made = multi_triangulation(hills(20, 0.0), COARSE)
    assert made.error[-2] == made.error[1] < 1e-7
    assert len(cuts.triangles(made, cuts.coarsest(made))) < 300


def test_leaves_with_two_sides_are_simplified() -> None:
    """Triangles for the back, with vertices of their own at the same places: edges have four
    triangles, but it is plain which two belong together."""
    front = hills(20)
    made = multi_triangulation(both(front, replace(front, faces=front.faces[:, ::-1])), COARSE)
    drawn = made.faces[cuts.triangles(made, cuts.coarsest(made))]
    assert len(drawn) < 0.6 * len(made.plant.faces)
    Border(made.plant).assert_kept(drawn)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"first": slice(None, -1)}, "first"),
        ({"error": slice(None, None, -1)}, "error"),
        ({"start": slice(None, None, -1)}, "start"),
        ({"radius": 0.1}, "radius"),
        ({"end": 1}, "start"),
    ],
)
def test_what_does_not_hang_together_is_refused(change: dict, message: str) -> None:
    made = multi_triangulation(hills(20), COARSE)
    (name, how), *_ = change.items()
    value = getattr(made, name)
    value = value[how] if isinstance(how, slice) else value * how if how != 1 else made.start
    with pytest.raises(ValueError, match=message):
        replace(made, **{name: value})


@pytest.mark.parametrize("epsilon", [0.0, -1.0, float("nan")])
def test_epsilon_must_be_above_nothing(epsilon: float) -> None:
    with pytest.raises(ValueError, match="epsilon"):
        multi_triangulation(hills(4), epsilon=epsilon)


def test_progress() -> None:
    """From nothing done to less than all, and never back."""
    told: list[tuple[str, float]] = []
    multi_triangulation(hills(20), COARSE, progress=lambda stage, done: told.append((stage, done)))
    done = [share for _, share in told]
    assert {stage for stage, _ in told} == {"triangles"}
    assert done[0] == 0.0
    assert done == sorted(done)
    assert done[-1] < 1.0
