"""The order in which elements are left out, against plain loops and an order at random."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from cards import arrays_of, cards, together, turned
from plants import plant_of
from scipy.spatial import cKDTree

from vegtool.arrays import unit
from vegtool.elements import (
    MORTON_BITS,
    MOST_FACES,
    WOOD_POWER,
    Elements,
    area_ranks,
    morton_codes,
    ordered,
    spread_ranks,
    van_der_corput,
)
from vegtool.growth import sample
from vegtool.plant import Material, Plant, Role
from vegtool.seeding import generator

WOOD = Material("wood")


def pieces(elements: Elements) -> list[list[int]]:
    """Faces that hang together by a vertex, found from face to face."""
    at = [np.flatnonzero(row) for row in _touching(elements.faces)]
    left, found = set(range(len(elements.faces))), []
    while left:
        piece = front = {min(left)}
        while front := {int(f) for face in front for f in at[face]} - piece:
            piece = piece | front
        found.append(sorted(piece))
        left -= piece
    return found


def _touching(faces: np.ndarray) -> np.ndarray:
    """(f, f) bool: faces that share a vertex."""
    uses = np.zeros((len(faces), faces.max() + 1), np.float32)
    uses[np.arange(len(faces))[:, None], faces] = 1
    return np.asarray(uses @ uses.T > 0)


def fan(triangles: int) -> Plant:
    """Triangles around one vertex, each beside the next: one connected piece."""
    angle = np.linspace(0, 5, triangles + 1)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    first = np.arange(triangles)
    faces = np.stack([0 * first, first + 1, first + 2], axis=1)
    points = np.concatenate([np.zeros((1, 3)), ring])
    up, uvs = np.tile([0.0, 0, 1], (len(points), 1)), np.zeros((len(points), 2))
    leaf = Material("leaf", role="leaf")
    return Plant("fan", points, up, uvs, faces, np.zeros(triangles, np.int32), (leaf,))


def crowns() -> dict[str, np.ndarray]:
    """Where leaves may be: in a ball, on its surface, along twigs, in one plane."""
    rng = generator(3, "crowns")
    inside = rng.normal(size=(4000, 3))
    ball = unit(inside) * rng.random((4000, 1)) ** (1 / 3)
    twigs = unit(rng.normal(size=(60, 3)))[rng.integers(60, size=4000)]
    along = twigs * rng.random((4000, 1)) + 0.02 * rng.normal(size=(4000, 3))
    plane = rng.random((4000, 3)) * (1, 0, 1)
    return {"ball": ball, "shell": unit(inside), "twigs": along, "plane": plane}


def nearest(points: np.ndarray) -> float:
    """Mean distance to the nearest of the others."""
    distance, _ = cKDTree(points).query(points, k=2)
    return float(distance[:, 1].mean())


def unevenness(points: np.ndarray, chosen: np.ndarray) -> float:
    """Squares of how many more, or fewer, than their share are in each of 64 cubes."""
    low, side = points.min(axis=0), np.ptp(points, axis=0).max()
    cube = np.minimum(4 * (points - low) / side, 3).astype(int) @ [1, 4, 16]
    share = np.bincount(cube, minlength=64) / len(points)
    found = np.bincount(cube[chosen], minlength=64)
    return float(((found - share * len(chosen)) ** 2).sum())


@pytest.mark.parametrize("crown", list(crowns()))
@pytest.mark.parametrize("count", [100, 377, 1000, 2048])
def test_every_first_part_is_spread_evenly(crown: str, count: int) -> None:
    """Farther from each other than those of orders at random, and in each part of the space nearly
    as many as are its share."""
    points = crowns()[crown]
    first = np.argsort(spread_ranks(points))[:count]
    rng = generator(1, "random")
    orders = [rng.permutation(len(points))[:count] for _ in range(5)]
    assert nearest(points[first]) > 1.05 * np.mean([nearest(points[o]) for o in orders])
    random = np.mean([unevenness(points, o) for o in orders])
    assert unevenness(points, first) < 0.25 * random


def test_ranks_are_evenly_spaced() -> None:
    rank = spread_ranks(crowns()["shell"][:999])
    np.testing.assert_array_equal(np.sort(rank), np.arange(999) / 999)
    assert spread_ranks(np.empty((0, 3))).shape == (0,)
    assert spread_ranks(np.ones((1, 3))).tolist() == [0]


def test_van_der_corputs_numbers() -> None:
    """Bits of the index, mirrored at the point."""
    assert van_der_corput(8).tolist() == [0, 1 / 2, 1 / 4, 3 / 4, 1 / 8, 5 / 8, 3 / 8, 7 / 8]
    for count in (1, 2, 3, 100):
        plain = [
            sum(int(bit) / 2 ** (place + 1) for place, bit in enumerate(f"{index:b}"[::-1]))
            for index in range(count)
        ]
        assert van_der_corput(count).tolist() == plain


def test_mortons_codes() -> None:
    points = generator(2, "morton").random((50, 3)) * (1.0, 0.5, 0.2)
    low, side = points.min(axis=0), np.ptp(points, axis=0).max()
    for point, code in zip(points, morton_codes(points), strict=True):
        cell = [int(c) for c in (point - low) / side * (2**MORTON_BITS - 1)]
        bits = [f"{c:0{MORTON_BITS}b}" for c in cell[::-1]]
        assert code == int("".join("".join(three) for three in zip(*bits, strict=True)), 2)
    assert morton_codes(np.full((3, 3), 7.0)).tolist() == [0, 0, 0]


def test_a_rank_is_the_share_of_all_area_in_larger_ones() -> None:
    """Of areas 1, 8, 4, 2 and 1, as thick as they are large: half of all is in the trunk."""
    area = np.array([1.0, 8, 4, 2, 1])
    assert area_ranks(area, area).tolist() == [14 / 16, 0, 8 / 16, 12 / 16, 15 / 16]
    thin = np.array([5.0, 1, 2, 3, 4])  # the largest is the thinnest
    assert area_ranks(thin, area).tolist() == [0, 8 / 16, 4 / 16, 2 / 16, 1 / 16]
    size, area = generator(4, "areas").random((2, 200))
    plain = [sum(a for s, a in zip(size, area, strict=True) if s > one) for one in size]
    np.testing.assert_allclose(area_ranks(size, area), np.array(plain) / area.sum(), atol=1e-12)
    nothing = np.zeros(4)
    assert area_ranks(np.empty(0), np.empty(0)).shape == (0,)
    assert area_ranks(nothing, nothing).tolist() == [0] * 4
    ends = np.array([1.0, 0.0])
    assert area_ranks(ends, ends)[1] < 1, "what has no area is drawn of a whole plant"


def test_wood_stays_as_long_as_it_is_thick_and_is_not_enlarged() -> None:
    """Triangles of one shape; where half of the elements are kept, wood has 0.8 of its area."""
    sizes, apart = np.array([0.1, 0.8, 0.3]), np.arange(3)[:, None, None] * [0.0, 0, 1]
    stems = plant_of(sizes[:, None, None] * [[0.0, 0, 0], [1, 0, 0], [0, 1, 0]] + apart)
    found = ordered(replace(stems, materials=(WOOD,)))
    area = np.linalg.norm(stems.face_area_vectors, axis=1)
    assert [found.vertex[face[0]] // 3 for face in found.faces] == [1, 2, 0]
    larger = np.array([0, area[1], area[1] + area[2]])
    np.testing.assert_allclose(found.face_rank, (larger / area.sum()) ** WOOD_POWER)
    assert not found.grows.any()
    assert ordered(stems).grows.all(), "leaves are"


def plants() -> dict[str, Plant]:
    rng = generator(5, "plants")
    foliage = cards(rng.normal(size=(150, 3)), 0.05, normals=rng.normal(size=(150, 3)))
    stems = replace(plant_of(rng.normal(size=(40, 3, 3))), materials=(WOOD,))
    return {"bush": sample("bush", 1200), "both": together(stems, foliage, foliage)}


@pytest.mark.parametrize("name", list(plants()))
def test_elements_are_a_partition_of_the_faces_in_order(name: str) -> None:
    plant = plants()[name]
    found = ordered(plant)
    drawn = np.column_stack([found.vertex[found.faces], found.face_material])
    given = np.column_stack([plant.faces, plant.face_material])
    assert sorted(map(tuple, drawn.tolist())) == sorted(map(tuple, given.tolist()))
    assert (np.diff(found.face_material) >= 0).all()
    for material in range(len(plant.materials)):
        rank = found.face_rank[found.face_material == material]
        assert (np.diff(rank) >= 0).all()
    assert found.face_rank.min() >= 0 and found.face_rank.max() < 1


@pytest.mark.parametrize("name", list(plants()))
def test_elements_share_no_vertices_and_each_has_one_rank_and_middle(name: str) -> None:
    plant = plants()[name]
    found = ordered(plant)
    assert sorted(np.unique(found.faces)) == list(range(len(found.vertex)))
    middles = plant.positions[found.vertex][found.faces].mean(axis=1)
    for here in pieces(found):
        corners = found.faces[here].ravel()
        role = plant.materials[found.face_material[here[0]]].role
        assert len(here) <= MOST_FACES[role]
        assert len({*found.face_material[here]}) == len({*found.grows[corners]}) == 1
        assert {*found.rank[corners]} == {*found.face_rank[here]}
        assert len({*found.rank[corners]}) == 1
        middle = np.tile(middles[here].mean(axis=0), (len(corners), 1))
        np.testing.assert_allclose(found.middle[corners], middle, atol=1e-12)
    leaf = np.array([m.role == "leaf" for m in plant.materials])[found.face_material]
    np.testing.assert_array_equal(found.grows[found.faces[:, 0]], leaf)


@pytest.mark.parametrize("role", ["leaf", "wood"])
def test_small_pieces_stay_whole_and_larger_ones_are_taken_apart(role: Role) -> None:
    """So no twig is left with holes in it, and of what is one piece all over, as fronds or a
    trunk with all of its branches, something is left."""
    most = MOST_FACES[role]
    for triangles in (1, most, most + 1, 3 * most):
        plant = replace(fan(triangles), materials=(Material(role, role=role),))
        assert len(pieces(ordered(plant))) == (1 if triangles <= most else triangles)


def test_pieces_of_two_materials_are_two_elements() -> None:
    """A card of which each triangle has a material of its own, and shares two vertices."""
    card = cards(np.zeros(3))
    both = replace(card, face_material=[0, 1], materials=(card.materials[0], WOOD))
    found = ordered(both)
    assert len(pieces(found)) == 2 and len(found.vertex) == 6


@pytest.mark.parametrize("foot", [(0, 0, 0), (3, -7, 4096)])
@pytest.mark.parametrize("scale", [1.0, 2.0**20, 2.0**-20])
def test_another_place_and_size_keep_the_order_to_the_bit(
    scale: float, foot: tuple[float, ...]
) -> None:
    """Coordinates in steps of 1/64 of the unit, so that nothing is rounded."""
    rng = generator(6, "moved")
    foliage = cards(np.round(64 * rng.normal(size=(120, 3))) / 64, 1 / 64)
    stems = replace(plant_of(np.round(64 * rng.normal(size=(30, 3, 3))) / 64), materials=(WOOD,))
    plant = together(foliage, stems)
    moved = replace(plant, positions=scale * (plant.positions + np.array(foot, np.float64)))
    here, there = ordered(plant), ordered(moved)
    for name in ("vertex", "faces", "face_material", "face_rank", "rank", "grows"):
        np.testing.assert_array_equal(getattr(here, name), getattr(there, name))
    np.testing.assert_allclose(there.middle, scale * (here.middle + foot), atol=1e-9 * scale)


@pytest.mark.parametrize("yaw", [0.3, np.pi / 2, 2.0])
def test_a_plant_that_is_turned_is_even_too(yaw: float) -> None:
    """In cubes that are not turned with it, which cut those of the curve."""
    points = crowns()["ball"][:2000]
    stems = replace(cards(points[:50], generator(2, "stems").random(50)), materials=(WOOD,))
    plant = together(cards(points, 0.01), stems)
    there = ordered(turned(plant, yaw, 1.0, (0, 0, 0)))
    leaf = there.face_material == 0
    first = there.faces[leaf][::2, 0][:200]
    number = there.vertex[first] // 4
    random = generator(2, "random").permutation(2000)[:200]
    assert unevenness(points, number) < 0.5 * unevenness(points, random)
    np.testing.assert_allclose(there.face_rank[~leaf], ordered(plant).face_rank[~leaf], atol=1e-12)


def test_the_order_of_the_file_is_of_no_effect() -> None:
    plant = cards(crowns()["shell"][:300], 0.01)
    shuffled = generator(7, "faces").permutation(len(plant.faces))
    mixed = replace(plant, faces=plant.faces[shuffled])

    def rank_of(one: Plant) -> dict[tuple[int, ...], float]:
        found = ordered(one)
        faces = found.vertex[found.faces].tolist()
        return {tuple(f): r for f, r in zip(faces, found.face_rank.tolist(), strict=True)}

    assert rank_of(plant) == rank_of(mixed)


@pytest.mark.parametrize("material", [WOOD, Material("leaf", role="leaf")])
def test_one_face_and_faces_without_area(material: Material) -> None:
    one = replace(plant_of([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]), materials=(material,))
    assert ordered(one).face_rank.tolist() == [0]
    point = np.ones((3, 3))
    line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    flat = replace(plant_of([point, line, line + np.array([0.0, 0, 1])]), materials=(material,))
    found = ordered(flat)
    assert len(found.faces) == 3 and (found.face_rank < 1).all()
    nothing = replace(plant_of([point, point]), materials=(material,))
    assert (ordered(nothing).face_rank < 1).all()


def test_inputs_stay_and_the_same_plant_has_the_same_order_to_the_bit() -> None:
    plant = plants()["bush"]
    before = arrays_of(plant)
    first, second = ordered(plant), ordered(sample("bush", 1200))
    assert arrays_of(plant) == before
    for field in fields(Elements):
        value = getattr(first, field.name)
        assert value.tobytes() == getattr(second, field.name).tobytes()
        assert not value.flags.writeable


def test_elements_are_checked_when_made() -> None:
    good = ordered(cards(np.eye(3)))
    with pytest.raises(ValueError, match=r"Elements\.face_rank"):
        replace(good, face_rank=good.face_rank[:-1])
    with pytest.raises(ValueError, match=r"Elements\.faces"):
        replace(good, faces=good.faces + 100)
