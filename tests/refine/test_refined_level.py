"""Refined levels of whatever there is: plants that lack something, and plants out of all bounds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from plants import plant_of

from vegtool.convert import ConvertOptions, convert
from vegtool.formats import ReadOptions, read_plant
from vegtool.formats.gltf import level_glb, write_chain
from vegtool.growth import sample
from vegtool.lod import LodChain
from vegtool.measure.options import MeasureOptions
from vegtool.measure.pictures import client_plant
from vegtool.plant import Material, Plant
from vegtool.seeding import generator

pytestmark = pytest.mark.gl
OPTIONS = ConvertOptions(billboards=20, levels=2)
TRIANGLE = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])


def bush() -> Plant:
    return sample("bush", 300)


def is_wood(plant: Plant) -> npt.NDArray[np.bool_]:
    roles = np.array([material.role == "wood" for material in plant.materials])
    return np.asarray(roles[plant.face_material])


def with_faces(plant: Plant, kept: npt.NDArray[np.bool_]) -> Plant:
    faces, materials = plant.faces[kept], plant.face_material[kept]
    return replace(plant, faces=faces, face_material=materials, branches=None)


def scaled(factors: npt.ArrayLike) -> Plant:
    plant = bush()
    return replace(plant, positions=plant.positions * np.asarray(factors, dtype=np.float64))


def painted(role: str, color: npt.ArrayLike) -> Plant:
    """The bush with one of its materials in another colour."""
    plant = bush()
    materials = tuple(
        replace(m, base_color=np.asarray(color)) if m.role == role else m for m in plant.materials
    )
    return replace(plant, materials=materials)


def with_degenerate_faces() -> Plant:
    """Faces that are points and lines, of wood and of leaves."""
    plant = bush()
    a, b = plant.faces[::7, 0], plant.faces[::7, 1]
    more = np.concatenate([np.stack([a, a, a], axis=1), np.stack([a, b, b], axis=1)])
    materials = np.tile(plant.face_material[::7], 2)
    return replace(
        plant,
        faces=np.concatenate([plant.faces, more]),
        face_material=np.concatenate([plant.face_material, materials]),
        branches=None,
    )


def wood_as_a_line() -> Plant:
    """Wood without any thickness among leaves that have some."""
    plant = bush()
    of_wood = np.isin(np.arange(len(plant.positions)), plant.faces[is_wood(plant)])
    line = plant.positions * [0.0, 1.0, 0.0]
    return replace(plant, positions=np.where(of_wood[:, None], line, plant.positions))


def soup(count: int) -> Plant:
    """Opaque triangles here and there, whose normals have nothing to do with them."""
    random = generator(0, "soup")
    middle = random.uniform(-1, 1, (count, 1, 3)) * [3.0, 5.0, 3.0]
    return plant_of(middle + random.normal(size=(count, 3, 3)) * 0.1)


def of_wood(corners: npt.ArrayLike) -> Plant:
    return replace(plant_of(corners), materials=(Material("bark", role="wood"),))


def one_sided() -> Plant:
    """Leaves that need quads for both sides, and wood that stands in the file twice with them."""
    plant = bush()
    return replace(plant, materials=tuple(replace(m, double_sided=False) for m in plant.materials))


PLANTS: dict[str, Callable[[], Plant]] = {
    "bare": lambda: with_faces(bush(), is_wood(bush())),
    "no wood": lambda: with_faces(bush(), ~is_wood(bush())),
    "one face of wood": lambda: with_faces(
        bush(), ~is_wood(bush()) | (is_wood(bush()).cumsum() == 1)
    ),
    "one face of leaves": lambda: with_faces(
        bush(), is_wood(bush()) | ((~is_wood(bush())).cumsum() == 1)
    ),
    "a triangle": lambda: plant_of(TRIANGLE),
    "a triangle of wood": lambda: of_wood(TRIANGLE),
    "two triangles far apart": lambda: plant_of([TRIANGLE[0], TRIANGLE[0] + 90.0]),
    "flat": lambda: scaled([1.0, 1.0, 0.0]),
    "a line": lambda: scaled([0.0, 1.0, 0.0]),
    "wood as a line": wood_as_a_line,
    "points and lines among faces": with_degenerate_faces,
    "a micrometre": lambda: scaled(np.full(3, 1e-6)),
    "a thousand kilometres": lambda: scaled(np.full(3, 1e6)),
    "leaves that nobody sees": lambda: painted("leaf", [1.0, 1.0, 1.0, 0.0]),
    "black wood": lambda: painted("wood", [0.0, 0.0, 0.0, 1.0]),
    "seen from one side": one_sided,
    "a soup": lambda: soup(3000),
}


def refined(plant: Plant, options: ConvertOptions = OPTIONS) -> LodChain:
    return convert(plant, options, MeasureOptions(measure="off"))


@pytest.mark.parametrize("name", PLANTS)
def test_there_are_levels_of_anything_that_clients_can_read(name: str, tmp_path: Path) -> None:
    """Fewer triangles in each, all of them finite, and the same triangles in the files."""
    plant = PLANTS[name]()
    chain = refined(plant)
    levels = chain.levels[1:]
    assert levels
    assert all(level.triangles <= 2 * OPTIONS.billboards for level in levels)
    write_chain(chain, tmp_path)
    for number, level in enumerate(levels, start=1):
        drawn = client_plant(level)
        assert np.isfinite(drawn.positions).all()
        far = np.abs(drawn.positions - plant.center).max()
        assert far < 3 * plant.radius, "nothing is drawn far from where it is"
        read = read_plant(tmp_path / f"{plant.name}_LOD{number}.glb", ReadOptions())
        assert len(read.faces) == level.triangles


def test_the_same_bytes_twice_and_the_seed_is_all_that_is_drawn_by_chance() -> None:
    one, two = (refined(bush(), replace(OPTIONS, seed=7)) for _ in range(2))
    for a, b in zip(one.levels[1:], two.levels[1:], strict=True):
        assert level_glb(a, "level") == level_glb(b, "level")
    assert len(refined(bush(), replace(OPTIONS, seed=8)).levels) > 1


def test_levels_for_the_smallest_size() -> None:
    """Below eight pixels a picture has no texels to speak of: both are made for as many."""
    chain = refined(bush(), replace(OPTIONS, pixels=8.0))
    assert len(chain.levels) > 1
    assert chain.levels[1].texels <= 2 * 64**2, "of colour and of normals"


def test_a_hundred_thousand_opaque_triangles() -> None:
    chain = refined(soup(100_000), replace(OPTIONS, levels=1))
    assert chain.levels[1].triangles <= 2 * OPTIONS.billboards
