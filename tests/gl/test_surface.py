"""What a camera sees before light falls on it, on squares of which all is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vegtool.arrays import FloatArray, unit
from vegtool.gl.draw import Shot, draw
from vegtool.gl.surface import surface
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lighting.light import Light
from vegtool.lod import Display
from vegtool.measure.pictures import shot_of
from vegtool.measure.views import Camera, around, direction
from vegtool.plant import Material, Plant, Texture

pytestmark = pytest.mark.gl
HALF = 5e-4
"""Normals and exposures are half floats: eleven bits."""
TINT = np.array([0.9, 1.0, 0.25])
LEAN = np.array([0.6, 0.0, 0.8])


def squares(materials: tuple[Material, ...], which: list[int]) -> Plant:
    """Upright unit squares facing +z in a row along x, each of one of the materials; each leans
    back a little, that no two lie in one plane."""
    count = len(which)
    corner = np.array([[-0.5, -0.5, 0.1], [0.5, -0.5, 0.1], [0.5, 0.5, -0.1], [-0.5, 0.5, -0.1]])
    corner = corner * 0.9
    uv = np.array([[0.0, 1], [1, 1], [1, 0], [0, 0]])
    at = np.stack([np.arange(count) - (count - 1) / 2, np.zeros(count), np.zeros(count)], axis=1)
    first = 4 * np.arange(count)[:, None, None]
    return Plant(
        "row",
        (at[:, None] + corner).reshape(-1, 3),
        np.tile(LEAN, (4 * count, 1)),
        np.tile(uv, (count, 1)),
        (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3),
        np.repeat(which, 2),
        materials,
    )


def front(back: bool = False, azimuth: float = 10.0, pixels: int = 96) -> Shot:
    """Four metres and a half across; looked at a little from the side."""
    view = direction(azimuth + 180.0 * back, 0)
    focal = 20 * pixels / 4.5
    middle = (pixels / 2, pixels / 2)
    return shot_of(Camera(np.zeros(3), view, 20.0, focal, pixels, pixels, middle, 4.0))


MATERIALS = (
    Material("green", base_color=[0.1, 0.5, 0.2, 1], double_sided=True, transmission=0.5),
    Material(
        "red", base_color=[0.8, 0.1, 0.0, 1], transmission=0.25, transmission_tint=TINT,
        double_sided=True,
    ),
    Material("none of these"),
    Material("grey", base_color=[0.3, 0.3, 0.3, 1], double_sided=True),
)  # fmt: skip


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("supersample", [1, 3])
def test_faces_keep_their_numbers_whatever_order_they_are_drawn_in(
    back: bool, supersample: int
) -> None:
    """Materials are drawn one after another; a sample's position lies on the face that it names,
    whose material's values it has."""
    plant = squares(MATERIALS, [3, 0, 1, 0])
    with PlantBuffers(plant) as buffers:
        assert (buffers.face_order != np.arange(8)).any()
        seen = surface(buffers, front(back), supersample)
    assert seen.size == (96 * supersample, 96 * supersample)
    assert set(seen.face) == set(range(8))
    corners = plant.corners[seen.face]
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
    normal = np.cross(edges[..., 0], edges[..., 1])
    matrix = np.concatenate([edges, normal[..., None]], axis=2)
    s, t, off = np.linalg.solve(matrix, (seen.position - corners[:, 0])[..., None])[..., 0].T
    assert np.abs(off).max() < 1e-5
    assert min(s.min(), t.min(), (1 - s - t).min()) > -1e-4
    material = plant.face_material[seen.face]
    for name, values in (
        ("color", [m.base_color[:3] for m in MATERIALS]),
        ("transmission", [m.transmission for m in MATERIALS]),
        ("tint", [m.transmission_tint for m in MATERIALS]),
    ):
        found = getattr(seen, name)
        np.testing.assert_allclose(found, np.array(values)[material], atol=1e-6, err_msg=name)


@pytest.mark.parametrize("back", [False, True])
def test_places_are_where_the_camera_sees_them(back: bool) -> None:
    """Projected again, they fall into the middle of their sample."""
    plant = squares(MATERIALS, [3, 0, 1, 0])
    shot = front(back)
    with PlantBuffers(plant) as buffers:
        seen = surface(buffers, shot)
    clip = np.c_[seen.position - shot.target, np.ones(len(seen.face))] @ shot.view_projection.T
    at = (0.5 + 0.5 * clip[:, :2] / clip[:, 3:] * [1, -1]) * [shot.width, shot.height]
    np.testing.assert_allclose(at, seen.at + 0.5, atol=1e-3)


@pytest.mark.parametrize("back", [False, True])
def test_a_card_turns_its_normal_to_whoever_looks_by_the_side_of_the_face(back: bool) -> None:
    """From behind, it is reversed, though it leans; exposures change places."""
    plant = squares(MATERIALS, [3, 0, 1, 0])
    plant = replace(plant, exposure=np.tile([0.75, 0.25], (len(plant.positions), 1)))
    with PlantBuffers(plant) as buffers:
        seen = surface(buffers, front(back))
    expected = np.tile(-LEAN if back else LEAN, (len(seen.face), 1))
    np.testing.assert_allclose(seen.normal, expected, atol=HALF)
    exposure = [0.25, 0.75] if back else [0.75, 0.25]
    np.testing.assert_allclose(seen.exposure, np.tile(exposure, (len(seen.face), 1)), atol=HALF)


def test_a_normal_that_points_away_from_the_viewer_stays_so() -> None:
    """Of a crown's leaves half do; the face decides."""
    plant = squares(MATERIALS, [0])
    plant = replace(plant, normals=np.tile([0.6, 0.0, -0.8], (4, 1)))
    with PlantBuffers(plant) as buffers:
        seen = surface(buffers, front())
    np.testing.assert_allclose(seen.normal[:, 2], -0.8, atol=HALF)


def test_sides_are_normals_of_the_faces_themselves() -> None:
    plant = squares(MATERIALS, [3, 0, 1, 0])
    with PlantBuffers(plant) as buffers:
        seen = surface(buffers, front())
    cosine = (unit(plant.face_area_vectors)[seen.face] * seen.side).sum(axis=1)
    np.testing.assert_allclose(np.abs(cosine), 1.0, atol=2 * HALF)


def test_single_sided_squares_are_not_there_from_behind() -> None:
    single = Material("single", base_color=[1, 1, 1, 1])
    plant = squares((single, MATERIALS[0]), [0, 1, 0])
    with PlantBuffers(plant) as buffers:
        assert set(surface(buffers, front()).face) == set(range(6))
        assert set(surface(buffers, front(back=True)).face) == {2, 3}


def test_where_nothing_is_seen_there_are_no_samples() -> None:
    plant = squares((Material("single"),), [0])
    with PlantBuffers(plant) as buffers:
        seen = surface(buffers, front(back=True))
    assert len(seen.face) == len(seen.tint) == len(seen.position) == 0
    picture = seen.picture(np.zeros((0, 3)))
    assert picture.shape == (96, 96, 4) and not picture.any()


def test_what_is_cut_away_is_not_seen_and_colours_multiply_in_linear_light() -> None:
    """sRGB 188 is half the light; the texture's left half has no alpha."""
    pixels = np.full((8, 8, 4), (188, 188, 188, 255), np.uint8)
    pixels[:, :4, 3] = 0
    leaf = Material(
        "leaf", np.array([0.5, 1, 1, 1]), Texture("t", pixels), alpha_mode="mask", double_sided=True
    )
    plant = squares((leaf,), [0])
    plant = replace(plant, colors=np.tile([1.0, 1.0, 0.25, 1.0], (4, 1)))
    with PlantBuffers(plant) as buffers:
        seen = surface(buffers, front())
    np.testing.assert_allclose(
        seen.color, np.tile([0.25, 0.5, 0.125], (len(seen.face), 1)), atol=3e-3
    )
    assert seen.position[:, 0].min() > -0.06, "half a texel of a texture of eight"


def test_what_is_baked_of_light_multiplies_what_vertices_and_material_say() -> None:
    baked = np.full((4, 4, 4), (51, 102, 0, 204), np.uint8)  # 0.2, 0.4, 0.8
    leaf = Material(
        "leaf", double_sided=True, transmission=0.5, light_texture=Texture("light", baked)
    )
    plant = replace(squares((leaf,), [0]), exposure=np.tile([0.5, 1.0], (4, 1)))
    with PlantBuffers(plant) as buffers:
        seen, behind = (surface(buffers, front(back)) for back in (False, True))
    assert seen.exposure == pytest.approx(np.tile([0.1, 0.4], (len(seen.face), 1)), abs=HALF)
    assert behind.exposure == pytest.approx(np.tile([0.4, 0.1], (len(behind.face), 1)), abs=HALF)
    assert seen.transmission == pytest.approx(0.4, abs=HALF)


def test_a_normal_texture_is_read_in_the_frame_of_the_texture() -> None:
    """It leans to the texture's right, which is +x here; from behind all of it is reversed."""
    lean = Texture("n", np.full((1, 1, 4), (204, 128, 229, 255), np.uint8))  # 0.6, 0, 0.8
    material = Material("m", normal_texture=lean, double_sided=True)
    plant = replace(squares((material,), [0]), normals=np.tile([0.0, 0, 1], (4, 1)))
    with PlantBuffers(plant) as buffers:
        seen, behind = (surface(buffers, front(back)) for back in (False, True))
    assert seen.normal == pytest.approx(np.tile([0.6, 0, 0.8], (len(seen.face), 1)), abs=0.01)
    assert behind.normal == pytest.approx(np.tile([-0.6, 0, -0.8], (len(behind.face), 1)), abs=0.01)
    np.testing.assert_allclose(np.linalg.norm(seen.normal, axis=1), 1.0, atol=2 * HALF)


def noise(seed: int = 0) -> Texture:
    pixels = np.full((256, 256, 4), 255, np.uint8)
    pixels[..., :3] = np.random.default_rng(seed).integers(0, 2, (256, 256, 1)) * 255
    return Texture("noise", pixels)


@pytest.mark.parametrize("mipmaps", [False, True])
@pytest.mark.parametrize("supersample", [1, 4])
def test_drawn_without_light_it_is_the_mean_of_its_samples(mipmaps: bool, supersample: int) -> None:
    """The same filter in both, that of a whole pixel."""
    unlit = Material("m", color_texture=noise(), unlit=True, double_sided=True)
    with PlantBuffers(squares((unlit,), [0, 0, 0]), mipmaps=mipmaps) as buffers:
        drawn = draw(buffers, front(), Light(), supersample)
        seen = surface(buffers, front(), supersample)
    samples = seen.picture(seen.color.astype(np.float64))
    mean = samples.reshape(96, supersample, 96, supersample, 4).mean(axis=(1, 3))
    np.testing.assert_allclose(drawn, mean, atol=1e-3)


def test_a_wider_footprint_takes_coarser_mips() -> None:
    """Black and white texels at random: the mean of 4 x 4 of them varies a quarter as much, about
    as much as one texel of a picture a quarter as wide does."""
    material = Material("m", color_texture=noise(), double_sided=True)
    spread: list[float] = []
    with PlantBuffers(squares((material,), [0]), mipmaps=True) as buffers:
        for footprint in (1.0, 2.0, 4.0, 8.0):
            seen = surface(buffers, front(pixels=960, azimuth=0), footprint=footprint)
            assert seen.color.mean() == pytest.approx(0.5, abs=0.02)
            spread.append(float(seen.color.std()))
    ratio: FloatArray = np.array(spread[1:]) / spread[:-1]
    assert (ratio < 0.75).all() and (ratio > 0.3).all()


def test_of_a_whole_tree_albedo_and_light_make_the_picture() -> None:
    """Under a light that comes alike from everywhere what is drawn is the albedo."""
    plant, display = sample("broadleaf", 2000), Display()
    shot = shot_of(around(plant.positions, direction(25, 8), display.distance_m(6.0), display))
    with PlantBuffers(plant) as buffers:
        seen = surface(buffers, shot)
        drawn = draw(buffers, shot, Light(sun=0.0, sky_above=1.0, sky_below=1.0))
    np.testing.assert_allclose(seen.picture(seen.color.astype(np.float64)), drawn, atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(seen.normal, axis=1), 1.0, atol=2 * HALF)
    assert seen.face.min() >= 0 and seen.face.max() < len(plant.faces)
    roles = np.array([m.role for m in plant.materials])[plant.face_material[seen.face]]
    assert set(roles) == {"leaf", "wood"}
    bounds = plant.bounds + np.array([[-1e-4], [1e-4]])
    assert ((seen.position >= bounds[0]) & (seen.position <= bounds[1])).all()
