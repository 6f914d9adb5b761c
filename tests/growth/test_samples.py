"""Every sample, as a user gets it: counts, sizes, reproducible bytes, sound geometry."""

from __future__ import annotations

import hashlib
import subprocess
import sys

import numpy as np
import pytest

from vegtool.errors import UsageError
from vegtool.growth import SAMPLES, sample
from vegtool.plant import Plant

PLANTS = [name for name in SAMPLES if name not in ("statue", "height-field")]
HEIGHTS = {  # metres
    "broadleaf": 10.0,
    "cherry": 7.0,
    "conifer": 15.0,
    "bush": 2.0,
    "palm": 8.0,
    "dead-tree": 9.0,
    "herb": 0.5,
    "grass-clump": 0.4,
    "statue": 2.0,
}


def digest(plant: Plant) -> str:
    """Of all that a plant is made of."""
    total = hashlib.sha256()
    arrays = [plant.positions, plant.normals, plant.uvs, plant.faces, plant.face_material]
    if plant.branches is not None:
        arrays += [plant.branches.face_branch, plant.branches.parent, plant.branches.level]
    for material in plant.materials:
        for texture in (material.color_texture, material.normal_texture):
            if texture is not None:
                arrays.append(texture.pixels)
    for array in arrays:
        total.update(np.ascontiguousarray(array).tobytes())
    return total.hexdigest()


@pytest.mark.parametrize("name", SAMPLES)
@pytest.mark.parametrize("triangles", [100, 200, 1_000, 7_777, None])
def test_has_about_as_many_triangles_as_asked(name: str, triangles: int | None) -> None:
    plant = sample(name, triangles)
    wanted = triangles or len(sample(name).faces)
    assert abs(len(plant.faces) - wanted) <= 0.05 * wanted


@pytest.mark.parametrize("name", SAMPLES)
@pytest.mark.parametrize("triangles", [200, None])
def test_geometry_is_sound(name: str, triangles: int | None) -> None:
    plant = sample(name, triangles)
    assert plant.face_areas.min() > 1e-12 * plant.radius**2
    np.testing.assert_allclose(np.linalg.norm(plant.normals, axis=1), 1.0, atol=1e-9)
    # Every vertex normal is on the side from which its faces turn counter-clockwise.
    facing = np.einsum("fci,fi->fc", plant.normals[plant.faces], plant.face_area_vectors)
    assert (facing > 0).mean() > 0.99
    assert len(np.unique(plant.faces)) == len(plant.positions)


@pytest.mark.parametrize("name", HEIGHTS)
def test_has_its_real_size_and_stands_on_the_ground(name: str) -> None:
    for seed in range(3):
        plant = sample(name, seed=seed)
        assert 0.75 * HEIGHTS[name] < plant.height < 1.3 * HEIGHTS[name]
        assert -0.03 * plant.height < plant.bounds[0, 1] < 0.01 * plant.height


@pytest.mark.parametrize("name", SAMPLES)
def test_a_seed_names_an_individual(name: str) -> None:
    first, again, other = (sample(name, 500, seed) for seed in (1, 1, 2))
    assert digest(first) == digest(again)
    assert digest(first) != digest(other)


def test_bytes_do_not_depend_on_the_number_of_threads() -> None:
    code = (
        "from vegtool.growth import sample; import hashlib;"
        "p = sample('palm', 2000);"
        "print(hashlib.sha256(p.positions.tobytes() + p.materials[0].normal_texture.pixels"
        ".tobytes()).hexdigest())"
    )
    results = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={"OPENBLAS_NUM_THREADS": threads, "OMP_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "4")
    }
    assert len(results) == 1


@pytest.mark.parametrize("name", ["broadleaf", "conifer", "bush", "palm"])
def test_the_same_plant_at_any_detail(name: str) -> None:
    """Leaf area and size stay, since a leaf that stands for more of them is larger."""
    coarse, fine = sample(name, 4_000), sample(name, 40_000)
    area = [plant.face_areas[plant.face_is_leaf].sum() for plant in (coarse, fine)]
    assert 0.85 < area[0] / area[1] < 1.18
    np.testing.assert_allclose(coarse.bounds, fine.bounds, atol=0.15 * fine.height)


@pytest.mark.parametrize("name", PLANTS)
def test_materials_say_what_they_are(name: str) -> None:
    plant = sample(name)
    roles = [material.role for material in plant.materials]
    assert sorted(set(plant.face_material)) == list(range(len(roles)))  # none is unused
    for material in plant.materials:
        assert material.color_texture is not None
        height, width, _ = material.color_texture.pixels.shape
        assert 256 <= height <= 512 and 256 <= width <= 512
        if material.role == "wood":
            assert material.normal_texture is not None and not material.double_sided
        else:
            assert material.double_sided
    assert ("leaf" in roles) == (name != "dead-tree")
    assert ("wood" in roles) == (name != "grass-clump")


def test_unknown_name_lists_the_choices() -> None:
    with pytest.raises(UsageError, match=r"no sample 'oka'.*broadleaf, cherry.*height-field"):
        sample("oka")


@pytest.mark.parametrize("triangles", [0, -3, 99, 1_000_000_000])
@pytest.mark.parametrize("name", ["broadleaf", "statue"])
def test_absurd_number_of_triangles(name: str, triangles: int) -> None:
    with pytest.raises(UsageError, match="between 100 and 10,000,000"):
        sample(name, triangles)
