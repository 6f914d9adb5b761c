"""Grids, noise, textures and parameter files, the parts of which samples are made."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.errors import InputError
from vegtool.growth import SAMPLES
from vegtool.growth.mesh import grid_faces, grid_triangles
from vegtool.growth.noise import gradient_noise
from vegtool.growth.species import Bark, parse_species, read_species
from vegtool.growth.stems import envelope_at, lay_out
from vegtool.growth.textures import bark_textures, leaf_texture
from vegtool.seeding import generator


def test_one_quad_is_two_faces_that_turn_counter_clockwise() -> None:
    # 2 3
    # 0 1
    assert grid_faces(1, 1, pointed=False).tolist() == [[0, 1, 3], [0, 3, 2]]


@pytest.mark.parametrize("rows", [1, 2, 5])
@pytest.mark.parametrize("columns", [1, 3])
@pytest.mark.parametrize("pointed", [False, True])
def test_grid_covers_its_plane_once(rows: int, columns: int, pointed: bool) -> None:
    faces = grid_faces(rows, columns, pointed)
    assert len(faces) == grid_triangles(rows, columns, pointed)
    row, column = np.divmod(np.arange((rows + 1) * (columns + 1)), columns + 1)
    x, y = column.astype(float), row.astype(float)
    if pointed:
        x[row == rows] = columns / 2  # the top row lies in one point
    a, b, c = (np.stack([x, y], 1)[faces[:, corner]] for corner in range(3))
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert (area > 0).all()
    assert area.sum() == pytest.approx(rows * columns - (columns / 2 if pointed else 0))


def test_children_are_laid_out_in_proportion_and_in_order() -> None:
    parent, along = lay_out(400, np.array([1.0, 3.0]), (0.2, 0.8), generator(0, "test"))
    assert np.bincount(parent).tolist() == [100, 300]
    assert along.min() >= 0.2 and along.max() <= 0.8
    assert (np.diff(parent + along) > 0).all()


def test_envelope_goes_through_its_values_at_even_steps() -> None:
    at = np.array([0.0, 0.25, 0.5, 1.0])
    np.testing.assert_allclose(envelope_at((1.0, 3.0, 2.0), at), [1.0, 2.0, 3.0, 2.0])


def test_noise_is_zero_on_the_lattice_and_smooth_between() -> None:
    rng = generator(0, "noise")
    lattice = np.array([[0.0, 1.0, 2.0], [5.0, -3.0, 4.0]])
    np.testing.assert_allclose(gradient_noise(lattice, rng), 0.0, atol=1e-12)
    line = np.stack([np.linspace(0, 9, 9001), np.full(9001, 0.3)], axis=1)
    values = gradient_noise(line, rng)
    assert np.abs(values).max() < 1.5 and values.std() > 0.1
    assert np.abs(np.diff(values)).max() < 0.01  # no jump where one cell ends


def test_bark_tiles() -> None:
    """Over the seam, neighbouring texels differ as they do anywhere else."""
    for texture in bark_textures(Bark()):
        pixels = texture.pixels.astype(float)
        for axis in (0, 1):
            inside = np.abs(np.diff(pixels, axis=axis)).mean()
            seam = np.abs(pixels.take(0, axis) - pixels.take(-1, axis)).mean()
            assert seam < 1.5 * inside


def test_bark_normals_are_unit_and_look_outward() -> None:
    vectors = bark_textures(Bark())[1].pixels[..., :3] / 127.5 - 1
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=-1), 1, atol=0.02)
    assert vectors[..., 2].min() > 0
    assert np.abs(vectors[..., :2].mean(axis=(0, 1))).max() < 0.02


@pytest.mark.parametrize("name", ["broadleaf", "cherry", "conifer", "bush", "herb"])
def test_leaves_are_cut_out_cleanly(name: str) -> None:
    for index, kind in enumerate(read_species(name).foliage):
        pixels = leaf_texture(name, index, kind).pixels
        alpha = pixels[..., 3]
        soft = ((alpha > 8) & (alpha < 247)).mean()
        assert 0.15 < (alpha > 127).mean() < 0.8
        assert soft < 0.12  # an edge one pixel wide
        # No black under alpha 0: the dark rim of filtered leaves comes from there.
        assert pixels[alpha == 0][:, :3].max(axis=1).min() > 20
        # Drawings stay clear of each other.
        middle = len(alpha) // 2
        assert alpha[: middle + 1, middle - 1 : middle + 1].max() == 0


@pytest.mark.parametrize("name", [n for n in SAMPLES if n not in ("statue", "height-field")])
def test_parameter_files_are_read(name: str) -> None:
    assert read_species(name).stems


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("triangles = ", "oak.toml"),
        ("triangles = 5\nwood_share = 1.0\nleafs = 3", "unknown key 'leafs'; known are"),
        ("triangles = 5", "wood_share"),
        ("[[stems]]\ncount = 1\nlength = 1\nradius = 1\nbend = 4", "unknown key 'bend'"),
    ],
)
def test_a_broken_parameter_file_says_what_is_wrong(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_species(text, "oak.toml")
