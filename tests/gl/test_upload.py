from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import moderngl
import numpy as np
import pytest

from vegtool.gl import upload
from vegtool.gl.context import describe, framebuffer_kept
from vegtool.gl.mipmaps import mip_levels
from vegtool.gl.program import source
from vegtool.gl.upload import PlantBuffers, bled_under_alpha, vertex_data
from vegtool.plant import Material, Plant, Texture

VERTEX = """#version 330 core
in vec4 in_position_u; in vec4 in_normal_v; in vec4 in_color;
out vec2 uv; out vec4 tint;
void main() {
    gl_Position = vec4(in_position_u.xyz * sqrt(2.0), 1.0);  // radii of the square
    uv = vec2(in_position_u.w, in_normal_v.w);
    tint = in_color;
}"""
FRAGMENT = (
    "#version 330 core\n"
    + source("material.glsl")
    + "in vec2 uv; in vec4 tint; out vec4 o;\nvoid main() { o = vec4(surface_color(uv, tint), 1); }"
)


def squares(materials, offset=0.0) -> Plant:
    """One square per material, side by side from x = -1 to 1 about `offset`."""
    count = len(materials)
    edge = np.linspace(-1, 1, count + 1)
    positions = [[[a, -1, 0], [b, -1, 0], [b, 1, 0], [a, 1, 0]] for a, b in pairwise(edge)]
    faces = 4 * np.arange(count)[:, None, None] + [[0, 1, 2], [0, 2, 3]]
    return Plant(
        "squares",
        np.reshape(positions, (-1, 3)) + offset,
        np.tile([0, 0, 1.0], (4 * count, 1)),
        np.tile([[0, 1], [1, 1], [1, 0], [0, 0.0]], (count, 1)),
        faces.transpose(1, 0, 2).reshape(-1, 3),  # materials alternate in the file
        np.tile(np.arange(count), 2),
        tuple(materials),
    )


def drawn(plant: Plant, size=16, **options) -> np.ndarray:
    with PlantBuffers(plant, **options) as buffers:
        ctx = buffers.ctx
        shader = ctx.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
        frame = ctx.simple_framebuffer((size, size))
        with framebuffer_kept(ctx):
            frame.use()
            frame.clear()
            array = buffers.vertex_array(shader)
            for group in buffers.groups:
                buffers.use(group, shader)
                array.render(moderngl.TRIANGLES, vertices=3 * group.count, first=3 * group.first)
            pixels = np.frombuffer(frame.read(components=4), np.uint8).reshape(size, size, 4)
        frame.release()
        return pixels[::-1].astype(int)


def test_vertices_are_relative_to_the_plants_centre():
    """A map coordinate would leave float32 no millimetres."""
    plant = squares([Material("m")], offset=5_000_000.0)
    data = vertex_data(plant, plant.center, 1.0)
    assert np.abs(data[:, :2]).max() == pytest.approx(1.0)


def test_a_plant_of_another_size_and_place_is_uploaded_with_the_same_roundings():
    """Units are its own radius: to the last bit, but for the roundings of the moved input."""
    plant = squares([Material("m"), Material("n")])
    grown = replace(plant, positions=1e6 * plant.positions)
    with PlantBuffers(plant) as here, PlantBuffers(grown) as there:
        assert here.vertices.read() == there.vertices.read()


def test_the_first_ring_under_alpha_0_takes_its_neighbours_colour():
    image = np.zeros((5, 6, 4), dtype=np.uint8)
    image[2, 2] = [10, 20, 30, 255]
    image[2, 4] = [50, 60, 70, 255]
    bled = bled_under_alpha(image)
    assert (bled[..., 3] == image[..., 3]).all()
    assert tuple(bled[1, 1, :3]) == (10, 20, 30)
    assert tuple(bled[2, 3, :3]) == (30, 40, 50)  # between the two
    assert tuple(bled[0, 0]) == (0, 0, 0, 0)
    assert tuple(image[1, 1]) == (0, 0, 0, 0)  # the plant's own image is untouched
    assert tuple(bled[2, 0, :3]) == (0, 0, 0)


@pytest.mark.gl
def test_every_material_draws_its_own_faces_with_its_factors():
    red = Texture("red", np.full((2, 2, 4), [255, 0, 0, 255], dtype=np.uint8))
    plant = squares([Material("a", color_texture=red), Material("b", np.array([0, 0.5, 0, 1.0]))])
    pixels = drawn(plant)
    assert (pixels[:, :8] == [255, 0, 0, 255]).all()
    assert (np.abs(pixels[:, 8:] - [0, 128, 0, 255]) <= 1).all()


@pytest.mark.gl
def test_textures_are_filtered_in_linear_light():
    """Half way between black and white lies half the light, not sRGB 128 (0.22 of it)."""
    image = np.zeros((1, 2, 4), dtype=np.uint8)
    image[..., 3] = 255
    image[0, 1, :3] = 255
    pixels = drawn(squares([Material("m", color_texture=Texture("t", image))]), size=65)
    assert pixels[32, 32, 0] == pytest.approx(127.5, abs=2)


@pytest.mark.gl
def test_cut_out_leaves_keep_their_colour_to_the_edge():
    image = np.zeros((8, 8, 4), dtype=np.uint8)
    image[2:6, 2:6] = [200, 100, 50, 255]
    leaf = Material("m", color_texture=Texture("t", image), alpha_mode="mask")
    pixels = drawn(squares([leaf]), size=64)
    shown = pixels[pixels[..., 3] > 0]
    assert len(shown) == pytest.approx(32 * 32, abs=100)
    assert (np.abs(shown - shown[0]) <= 1).all()


@pytest.mark.gl
def test_a_texture_that_is_cut_out_and_opaque_is_bled_for_the_one_alone():
    image = np.zeros((4, 4, 4), dtype=np.uint8)
    image[1, 1] = [200, 100, 50, 255]
    shared = Texture("t", image)
    leaf = Material("leaf", color_texture=shared, alpha_mode="mask")
    plant = squares([leaf, Material("paper", color_texture=shared)])
    with PlantBuffers(plant) as buffers:
        read = [
            np.frombuffer(g.color_map.read(), np.uint8).reshape(4, 4, 4) for g in buffers.groups
        ]
    assert tuple(read[0][0, 0, :3]) == (200, 100, 50)
    assert tuple(read[1][0, 0, :3]) == (0, 0, 0)


@pytest.mark.gl
def test_many_vertices_take_wider_rows_rather_than_too_many(monkeypatch):
    """Of a driver whose textures have four rows at most: 12 vertices, 3 in a row of 9 texels."""
    plant = squares([Material("a"), Material("b"), Material("c")])
    monkeypatch.setattr(upload, "VERTICES_PER_ROW", 1)
    monkeypatch.setattr(upload, "describe", lambda ctx: replace(describe(ctx), max_texture=4))
    with PlantBuffers(plant) as buffers:
        texture = buffers.vertex_texture
        assert texture.size == (9, 4)
        read = np.frombuffer(texture.read(), np.float32).reshape(12, 12)
    np.testing.assert_array_equal(read, vertex_data(plant, plant.center, plant.radius))


@pytest.mark.gl
def test_leaving_frees_what_was_made():
    buffers = PlantBuffers(squares([Material("m")]))
    with buffers:
        texture = buffers.groups[0].color_map
    assert texture.mglo is not None
    assert type(texture.mglo).__name__ == "InvalidObject"
    assert buffers.ctx.error == "GL_NO_ERROR"


def levels_of(texture: moderngl.Texture) -> list[np.ndarray]:
    """Its mips below the first, (h, w, 4) each."""
    found, level = [], 0
    while max(texture.size) >> level > 1:
        level += 1
        size = [max(n >> level, 1) for n in texture.size]
        read = np.frombuffer(texture.read(level=level), np.uint8)
        found.append(read.reshape(size[1], size[0], 4))
    return found


@pytest.mark.gl
def test_coverage_is_kept_where_that_is_wanted_and_leaves_are_cut_out():
    """At the alpha that the factor leaves of the cutoff: 0.3 of 0.6."""
    image = np.random.default_rng(0).integers(0, 256, (16, 32, 4), dtype=np.uint8)
    shared = Texture("t", image)
    leaf = Material("leaf", [1, 1, 1, 0.6], shared, alpha_mode="mask", alpha_cutoff=0.3)
    plant = squares([leaf, Material("paper", color_texture=shared, normal_texture=shared)])
    for kept, cutoff in ((True, 0.5), (False, None)):
        with PlantBuffers(plant, mipmaps=True, keep_coverage=kept) as buffers:
            cut, whole = buffers.groups
            for made, wanted in (
                (cut.color_map, mip_levels(image, True, cutoff)),
                (whole.color_map, mip_levels(image, True)),
                (whole.normal_map, mip_levels(image, False)),
            ):
                for found, level in zip(levels_of(made), wanted, strict=True):
                    np.testing.assert_array_equal(found, level)


@pytest.mark.gl
def test_bytes_of_textures_are_those_of_all_their_texels():
    """16 x 16 and 8 x 4 texels and their mips; one that two materials share is one, and a material
    without a texture has one white texel."""
    shared = Texture("t", np.full((16, 16, 4), 255, np.uint8))
    other = Texture("u", np.full((8, 4, 4), 255, np.uint8))
    plant = squares(
        [
            Material("a", color_texture=shared),
            Material("b", color_texture=shared, normal_texture=other),
        ]
    )
    for mipmaps in (False, True):
        with PlantBuffers(plant, mipmaps=mipmaps) as buffers:
            made = [buffers.groups[1].color_map, buffers.groups[1].normal_map]
            texels = 16 * 16 + 8 * 4
            if mipmaps:
                texels += sum(level[..., 0].size for one in made for level in levels_of(one))
            assert buffers.texture_bytes == pytest.approx(4 * texels, abs=8)
    with PlantBuffers(squares([Material("m")])) as buffers:
        assert buffers.texture_bytes == 4
