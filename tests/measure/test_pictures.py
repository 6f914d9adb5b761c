"""Pictures by the camera, on shapes whose picture is known."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from golden_pictures import assert_golden
from hybrids import hybrid_of
from PIL import Image

from vegtool.convert import ConvertOptions, convert
from vegtool.formats import read_plant
from vegtool.formats.gltf import level_glb
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lighting.light import Light
from vegtool.lod import Atlas, Billboards, Display, Level
from vegtool.measure.background import bytes_over
from vegtool.measure.contact_sheet import _caption, contact_sheet
from vegtool.measure.options import MeasureOptions
from vegtool.measure.pictures import client_plant, fragments, frame_seconds, live, truth
from vegtool.measure.views import Camera, direction, framed
from vegtool.plant import Material, Plant, Texture

pytestmark = pytest.mark.gl
AMBIENT = Light(sun=0.0, sky_above=1.0, sky_below=1.0)


def square(material: Material, offset: float = 0.0) -> Plant:
    """A unit square in the plane z = 0, facing +z."""
    corners = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], float)
    faces = [[0, 1, 2], [0, 2, 3]]
    normals = np.tile([0.0, 0, 1], (4, 1))
    return Plant("square", corners + offset, normals, uvs, faces, [0, 0], (material,))


def front(offset: float = 0.0, back: bool = False) -> Camera:
    """Sees two metres of height in 64 pixels."""
    to_eye = direction(180.0 * back, 0)
    return Camera(np.full(3, offset), to_eye, 10.0, 320.0, 64, 64, (32.0, 32.0), 2.0)


def test_a_square_covers_a_quarter_of_the_frame_in_its_own_colour() -> None:
    red = Material("red", base_color=[0.5, 0.1, 0.0, 1.0])
    with PlantBuffers(square(red)) as buffers:
        picture = truth(buffers, front(), AMBIENT)
    assert picture[..., 3].mean() == pytest.approx(0.25, abs=0.002)
    np.testing.assert_allclose(picture[32, 32], [0.5, 0.1, 0, 1], atol=1e-3)
    assert not picture[:15].any()


def test_single_sided_is_not_seen_from_behind_and_double_sided_is() -> None:
    for double_sided in (False, True):
        with PlantBuffers(square(Material("m", double_sided=double_sided))) as buffers:
            for picture in (truth, live):
                assert picture(buffers, front(back=True), AMBIENT).any() == double_sided


def test_truth_and_live_have_the_same_light_on_both_sides() -> None:
    """The sun at 60 degrees from the one normal, behind the other; the sky from the side."""
    light = Light(direction=np.array([3**0.5, 0.0, 1.0]), sun=0.8, sky_above=0.3, sky_below=0.1)
    with PlantBuffers(square(Material("m", double_sided=True)), mipmaps=True) as buffers:
        for picture in (truth, live):
            assert picture(buffers, front(), light)[32, 32, 0] == pytest.approx(0.6, abs=1e-3)
            back = picture(buffers, front(back=True), light)
            assert back[32, 32, 0] == pytest.approx(0.2, abs=1e-3)


def test_a_square_is_so_many_fragments_and_its_frames_take_time() -> None:
    with PlantBuffers(square(Material("m")), mipmaps=True) as buffers:
        assert fragments(buffers, front()) == 32 * 32
        assert fragments(buffers, front(back=True)) == 0
        seconds = frame_seconds(buffers, front(), repeats=3)
    assert seconds.shape == (3,) and (seconds > 0).all()


def test_the_truth_keeps_the_coverage_that_alpha_tested_mips_lose() -> None:
    """One texel in four is leaf: supersampled, a quarter of the square is covered; through mips,
    alpha averages to a quarter, below the cutoff, and nothing is left."""
    pixels = np.zeros((256, 256, 4), np.uint8)
    pixels[::2, ::2] = 255
    leaf = Material("leaf", color_texture=Texture("t", pixels), alpha_mode="mask")
    with PlantBuffers(square(leaf)) as buffers:
        nearest = truth(buffers, front(), AMBIENT, supersample=8)
    with PlantBuffers(square(leaf), mipmaps=True) as buffers:
        assert live(buffers, front(), AMBIENT)[..., 3].sum() == 0
    assert nearest[16:48, 16:48, 3].mean() > 0.2


def barky(double_sided: bool, material: Material) -> Level:
    """A billboard out of view, on an atlas of noise, and a square of bark in front of the eye."""
    noise = np.random.default_rng(3).integers(0, 256, (64, 64, 4), np.uint8)
    noise[40:48, 20:28] = 255
    normal = noise[..., :3] | np.array([0, 0, 128], np.uint8)
    normal[40:48, 20:28] = (128, 128, 255)
    picture = np.array([[2, 2, 30, 30]])
    atlas = Atlas(noise, normal, np.zeros((64, 64)), picture, picture, [22, 42, 4, 4])
    x, y, _ = np.eye(3)
    plane = Billboards([[50.0, 0, 0]], x[None], y[None], [[0.5, 0.5]], [0.0], [0])
    bark = replace(square(material), colors=np.tile([0.2, 0.1, 0.05, 1.0], (4, 1)))
    return Level("hybrid", bark, plane, atlas, double_sided=double_sided)


@pytest.mark.parametrize("pixels", [320.0, 40.0, 20.0])
@pytest.mark.parametrize("anisotropy", [1, 4])
def test_the_mesh_of_a_hybrid_has_its_own_colour_at_every_size(
    pixels: float, anisotropy: int
) -> None:
    """32, 4 and 2 pixels across: mips of the noise would show long before. Where a client
    culls, faces of double-sided wood are seen from behind all the same, and others are not."""
    light = Light(direction=np.array([0.0, 0, 1]), sun=1.0, sky_above=0.0, sky_below=0.0)
    for double_sided, both in ((True, False), (False, True), (False, False)):
        level = barky(double_sided, Material("bark", double_sided=both))
        with PlantBuffers(client_plant(level), mipmaps=True) as buffers:
            assert len(buffers.groups) == 1
            camera = replace(front(), focal_px=pixels)
            picture = live(buffers, camera, light, anisotropy)
            assert picture[..., 3].sum() == pytest.approx((pixels / 10) ** 2, abs=0.3)
            shown = picture[..., :3].sum(axis=(0, 1)) / picture[..., 3].sum()
            np.testing.assert_allclose(shown, [0.2, 0.1, 0.05], rtol=0.01)
            back = live(buffers, replace(camera, direction=direction(180, 0)), AMBIENT, anisotropy)
            assert back[..., 3].sum() == pytest.approx(
                (pixels / 10) ** 2 * (double_sided or both), abs=0.3
            )


def test_a_hybrids_file_shows_what_is_measured(tmp_path: Path) -> None:
    """The tree of the samples, its wood as a mesh: drawn from the level, and from its file as it
    is read; a file's numbers have fewer digits, so that an edge may fall to the other side."""
    plant = sample("broadleaf", 3000)
    level = hybrid_of(plant, 60, 20.0)
    path = tmp_path / "tree.glb"
    path.write_bytes(level_glb(level, "tree"))
    camera = framed(plant.center, plant.radius, direction(25, 8), 4 * plant.radius, Display())
    with (
        PlantBuffers(client_plant(level), mipmaps=True) as mine,
        PlantBuffers(read_plant(path), mipmaps=True) as theirs,
    ):
        for anisotropy in (1, 4):
            expected, found = (live(b, camera, None, anisotropy) for b in (mine, theirs))
            assert expected[..., 3].sum() > 5000
            assert np.mean(np.abs(expected - found).max(axis=2) > 2e-3) < 0.005


def test_far_from_the_origin_the_picture_is_the_same() -> None:
    """5e6 metres: float32 alone would put vertices half a metre apart."""
    material = Material("m", base_color=[0.2, 0.4, 0.6, 1])
    with PlantBuffers(square(material)) as near, PlantBuffers(square(material, 5e6)) as far:
        np.testing.assert_array_equal(truth(near, front()), truth(far, front(5e6)))


def test_half_the_light_over_white_is_not_half_the_grey() -> None:
    half = np.array([[[0.0, 0, 0, 0.5]]], np.float32)
    assert bytes_over(half, (1, 1, 1))[0, 0, 0] == 188, "linear 0.5 is sRGB 188"


def test_a_caption_agrees_with_what_is_written() -> None:
    """A mesh of known exposure has an image on disk, the ramp that its exposure is looked up in."""
    plant = square(Material("m"))
    exposed = replace(plant, exposure=np.ones((len(plant.positions), 2)))
    for mesh, says in ((plant, "no textures"), (exposed, "no textures, but a ramp for exposure")):
        assert says in [text for text, _ in _caption(Level("mesh", mesh=mesh), 1)]


def test_contact_sheet_is_the_one_that_was_looked_at() -> None:
    options = ConvertOptions(billboards=512, levels=2, refine="none")
    chain = convert(sample("broadleaf", 4000), options, MeasureOptions(measure="off"))
    sheet = np.asarray(Image.open(BytesIO(contact_sheet(chain))).convert("RGB"))
    assert_golden("contact_sheet_broadleaf", sheet)
