"""One material for several levels: its pictures, its colours, both sides, and what cannot be."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from cards import arrays_of, cards, texture, together

from vegtool.errors import UsageError
from vegtool.lod import Triangles
from vegtool.plant import Material, Plant, Texture
from vegtool.seeding import generator
from vegtool.srgb import linear_from_srgb
from vegtool.tiles.sheet import BRIGHTEST, FLAT, GUTTER, WHITE, Sheet, sheet_of

DULL = 230
"""The brightest sRGB that BRIGHTEST times as much light still fits above: 0.79 of white."""


def noise(height: int, width: int, seed: int = 0, top: int = DULL) -> Texture:
    """A picture of which no texel is as another."""
    pixels = generator(seed, "picture").integers(0, top + 1, (height, width, 4))
    return texture(pixels, f"noise {seed}")


def leaf(picture: Texture | None, **other: object) -> Material:
    values = {"color_texture": picture, "alpha_mode": "mask", "double_sided": True, "role": "leaf"}
    return Material("leaf", **(values | other))  # type: ignore[arg-type]


def painted(color: npt.ArrayLike, **other: object) -> Material:
    """Without a picture."""
    return leaf(None, base_color=np.array(color), alpha_mode="opaque", **other)


def corners(part: Triangles) -> np.ndarray:
    """(f, 3, 3) metres."""
    return part.positions[part.indices].reshape(-1, 3, 3)


def texels(sheet: Sheet, part: Triangles, shape: tuple[int, ...], of: str = "color") -> np.ndarray:
    """What a card shows at the middle of each texel of a picture of that shape, one by one."""
    (left, bottom), (right, top) = part.uvs[0], part.uvs[2]
    pixels = getattr(sheet, of)
    found = np.zeros((*shape[:2], 4), np.uint8)
    for row in range(shape[0]):
        for column in range(shape[1]):
            u = left + (right - left) * (column + 0.5) / shape[1]
            v = top + (bottom - top) * (row + 0.5) / shape[0]
            y, x = v * pixels.shape[0], u * pixels.shape[1]
            found[row, column] = pixels[int(y), int(x)]
    return found


def test_a_card_shows_its_picture_brighter_by_what_tints_are_divided_by() -> None:
    """To half a step of 8 bits, which is 1.6 % of light where it is bright, and of sRGB's dark end
    all is below 1 / 255."""
    picture = noise(6, 10)
    sheet = sheet_of([cards([0, 1, 0], 0.5, leaf(picture))], 256)
    seen = texels(sheet, sheet.parts[0], picture.pixels.shape)
    np.testing.assert_array_equal(seen[..., 3], picture.pixels[..., 3])
    shown = linear_from_srgb(seen[..., :3] / 255) / BRIGHTEST
    wanted = linear_from_srgb(picture.pixels[..., :3] / 255)
    np.testing.assert_allclose(shown, wanted, atol=0.0005, rtol=0.008)


def test_what_has_no_picture_shows_white_in_its_own_color() -> None:
    """Its colour is BRIGHTEST times the material's, its alpha of no account: it is opaque."""
    bark = cards([0, 1, 0], 0.5, painted([0.4, 0.2, 0.1, 1.0]))
    sheet = sheet_of([replace(bark, colors=np.tile([0.5, 1.0, 1.0, 0.2], (4, 1)))], 256)
    (part,) = sheet.parts
    assert (part.uvs == part.uvs[0]).all(), "one place, so that no client takes a smaller mip"
    height, width = sheet.color.shape[:2]
    x, y = (part.uvs[0] * (width, height)).astype(int)
    assert (
        sheet.color[y - WHITE // 2 : y + WHITE // 2, x - WHITE // 2 : x + WHITE // 2] == 255
    ).all()
    wanted = np.array([0.2, 0.2, 0.1]) * BRIGHTEST
    assert part.colors is not None
    np.testing.assert_allclose(part.colors, np.tile([*wanted, 1.0], (4, 1)), rtol=1e-12)


def test_a_picture_is_multiplied_by_the_material_and_its_vertices() -> None:
    """The picture by the material: what is a plant's own colour, and no tint, is in the picture."""
    factor = np.array([0.5, 1, 0.25, 0.5])
    picture = texture(np.full((4, 4, 4), (188, 188, 188, 240)))  # 0.5 in linear light
    card = cards([0, 1, 0], 0.5, leaf(picture, base_color=factor))
    own = generator(0, "colours").random((4, 4))
    sheet = sheet_of([replace(card, colors=own)], 256)
    (part,) = sheet.parts
    np.testing.assert_array_equal(part.colors, own)
    shown = texels(sheet, part, (4, 4))[0, 0] / 255
    light = linear_from_srgb(shown[:3])
    np.testing.assert_allclose(light, np.minimum(0.5 * BRIGHTEST * factor[:3], 1), rtol=0.03)
    assert shown[3] == pytest.approx(0.5 * 240 / 255, abs=1 / 255)


def test_pictures_lie_apart_and_go_on_into_the_gutter() -> None:
    """So that a linear tap at a picture's edge, in the second mip too, sees nothing but it."""
    pictures = [noise(5, 9, 1), noise(12, 4, 2), noise(3, 3, 3)]
    sheet = sheet_of([cards([0, 1, 0], 0.5, leaf(one)) for one in pictures], 256)
    height, width = sheet.color.shape[:2]
    taken = np.zeros((height, width), int)
    for part, picture in zip(sheet.parts, pictures, strict=True):
        seen = texels(sheet, part, picture.pixels.shape)
        left, top = np.rint(part.uvs.min(axis=0) * (width, height)).astype(int)
        rows, columns = picture.pixels.shape[:2]
        for y in range(top - GUTTER, top + rows + GUTTER):
            for x in range(left - GUTTER, left + columns + GUTTER):
                taken[y, x] += 1
                nearest = seen[np.clip(y - top, 0, rows - 1), np.clip(x - left, 0, columns - 1)]
                assert (sheet.color[y, x] == nearest).all(), (y, x)
    assert taken.max() == 1


def test_a_picture_of_several_levels_is_there_once() -> None:
    picture = noise(16, 16)
    levels = [cards([0, k, 0], 0.5, leaf(picture)) for k in range(3)]
    three, one = sheet_of(levels, 256), sheet_of(levels[:1], 256)
    assert three.color.tobytes() == one.color.tobytes()
    np.testing.assert_array_equal(three.parts[0].uvs, three.parts[2].uvs)


def test_normals_lie_where_their_colors_do() -> None:
    """A level without has a flat one there, a picture of half the size is made as large."""
    bumps = noise(3, 4, 7, 255)
    levels = [
        cards([0, 1, 0], 0.5, leaf(noise(6, 8, 1), normal_texture=bumps)),
        cards([0, 2, 0], 0.5, leaf(noise(5, 5, 2))),
        cards([0, 3, 0], 0.5, painted([0.1, 0.2, 0.3, 1.0])),
    ]
    sheet = sheet_of(levels, 256)
    assert sheet.normal is not None and sheet.normal.shape == sheet.color.shape
    seen = texels(sheet, sheet.parts[0], (6, 8), "normal")
    for row in range(6):
        for column in range(8):
            assert (seen[row, column] == bumps.pixels[row // 2, column // 2]).all()
    assert (texels(sheet, sheet.parts[1], (5, 5), "normal") == FLAT).all()
    assert (texels(sheet, sheet.parts[2], (1, 1), "normal") == FLAT).all()
    assert sheet_of(levels[1:], 256).normal is None


def test_tangents_run_along_the_picture() -> None:
    """Along u, which of a card in the plane of x and y is x."""
    bumped = leaf(noise(4, 4, 1), normal_texture=noise(4, 4, 2))
    (part,) = sheet_of([cards([0, 1, 0], 0.5, bumped)], 256).parts
    np.testing.assert_allclose(part.tangents, np.tile([1.0, 0, 0, 1], (4, 1)), atol=1e-12)


def test_a_part_is_its_level() -> None:
    """All triangles, material by material, where they were and facing as they did."""
    one = cards([[0, 1, 0], [1, 1, 0]], 0.3, painted([0.1, 0.2, 0.3, 1.0]), [1.0, 0, 0])
    two = cards([[0, 2, 0]], 0.5, leaf(noise(4, 4)), [0.0, 0, 1])
    plant = together(one, two)
    (part,) = sheet_of([plant], 256).parts
    order = np.argsort(plant.face_material, kind="stable")
    np.testing.assert_array_equal(corners(part), plant.corners[order])
    np.testing.assert_array_equal(
        part.normals[part.indices].reshape(-1, 3, 3), plant.normals[plant.faces[order]]
    )


def test_levels_are_their_parts_in_order_and_unused_materials_are_left_out() -> None:
    spare = leaf(noise(64, 64, 9), double_sided=False)
    first = cards([0, 1, 0], 0.5, leaf(noise(4, 4)))
    levels = [replace(first, materials=(*first.materials, spare)), cards([0, 5, 0], 0.2)]
    sheet = sheet_of(levels, 64)
    assert sheet.double_sided and sheet.color.shape[0] < 64
    for part, level in zip(sheet.parts, levels, strict=True):
        np.testing.assert_array_equal(corners(part), level.corners)


def test_what_has_two_sides_stands_there_twice_beside_what_has_one() -> None:
    """The second time turned over; what has one side stays as it is."""
    both = cards([[0, 1, 0], [0, 2, 0]], 0.5, leaf(noise(4, 4)))
    single = cards([0, 1, 0], 0.5, leaf(noise(4, 4, 1), double_sided=False))
    assert sheet_of([both, both], 256).double_sided
    sheet = sheet_of([both, single], 256)
    assert not sheet.double_sided and not sheet.material("m").double_sided
    twice, once = (corners(part) for part in sheet.parts)
    np.testing.assert_array_equal(twice[:4], both.corners)
    np.testing.assert_array_equal(twice[4:], both.corners[:, ::-1])
    np.testing.assert_array_equal(once, single.corners)
    part = sheet.parts[0]
    np.testing.assert_array_equal(part.normals, np.concatenate([both.normals, -both.normals]))
    np.testing.assert_array_equal(part.uvs[:8], part.uvs[8:])


def test_the_material_is_the_sheet_cut_out() -> None:
    bumped = leaf(noise(4, 4, 1), normal_texture=noise(4, 4, 2))
    sheet = sheet_of([cards([0, 1, 0], 0.5, bumped)], 256)
    made = sheet.material("wood")
    assert made.color_texture is not None and made.normal_texture is not None
    assert made.color_texture.pixels.tobytes() == sheet.color.tobytes()
    assert made.normal_texture.pixels.tobytes() == np.asarray(sheet.normal).tobytes()
    assert (made.alpha_mode, made.alpha_cutoff) == ("mask", 0.5)


def test_the_same_levels_give_the_same_sheet_and_stay_as_they_are() -> None:
    levels = [
        together(cards([0, k, 0], 0.5, leaf(noise(4 + k, 7, k))), cards([0, 1, 1], 0.5))
        for k in range(3)
    ]
    before = [arrays_of(level) for level in levels]
    one, two = sheet_of(levels, 256), sheet_of(levels, 256)
    assert [arrays_of(level) for level in levels] == before
    assert one.color.tobytes() == two.color.tobytes()
    for a, b in zip(one.parts, two.parts, strict=True):
        assert a.positions.tobytes() == b.positions.tobytes() and a.uvs.tobytes() == b.uvs.tobytes()


def test_a_moved_level_has_a_moved_part() -> None:
    card = cards([0, 1, 0], 0.5, leaf(noise(4, 4)))
    (here,), (there,) = (
        sheet_of([replace(card, positions=card.positions + moved)], 256).parts
        for moved in ([0, 0, 0], [4.0, 8, -2])
    )
    np.testing.assert_array_equal(there.positions, here.positions + np.array([4.0, 8, -2]))
    np.testing.assert_array_equal(there.uvs, here.uvs)


def test_pictures_that_do_not_fit_are_told() -> None:
    """Four of 32 texels and their gutters are 80 texels a side at least."""
    levels = [cards([0, 1, 0], 0.5, leaf(noise(32, 32, k))) for k in range(4)]
    with pytest.raises(UsageError, match=r"--max-texture: .* of 4 levels, .* got 64"):
        sheet_of(levels, 64)
    assert max(sheet_of(levels, 128).color.shape) <= 128


def test_textures_that_repeat_are_told_with_the_file() -> None:
    """A thousandth of a picture beyond its edge is rounding."""
    card = replace(cards([0, 1, 0], 0.5, leaf(noise(4, 4))), source="oak.glb")
    with pytest.raises(UsageError, match=r"oak\.glb: repeats its textures"):
        sheet_of([replace(card, uvs=2 * card.uvs)], 256)
    near, own = (
        sheet_of([replace(card, uvs=uvs)], 256).parts[0].uvs
        for uvs in (card.uvs * 1.0005, card.uvs)
    )
    np.testing.assert_allclose(near, own, atol=1e-12)


def test_many_pictures_never_overlap() -> None:
    rng = generator(1, "sizes")
    pictures = [noise(int(h), int(w), k) for k, (h, w) in enumerate(rng.integers(1, 30, (20, 2)))]
    sheet = sheet_of([cards([0, 1, 0], 0.5, leaf(one)) for one in pictures], 512)
    height, width = sheet.color.shape[:2]
    boxes = []
    for part, picture in zip(sheet.parts, pictures, strict=True):
        low = np.rint(part.uvs.min(axis=0) * (width, height)).astype(int)
        boxes.append((*low, *(low + picture.pixels.shape[1::-1])))
    apart = 2 * GUTTER
    for index, (left, top, right, bottom) in enumerate(boxes):
        for x0, y0, x1, y1 in boxes[index + 1 :]:
            beside = x0 >= right + apart or left >= x1 + apart
            assert beside or y0 >= bottom + apart or top >= y1 + apart
    assert all(a != b for a, b in pairwise(sorted(boxes)))


def shown(plant: Plant) -> np.ndarray:
    """(3,) linear: what a plant of one colour shows at its first vertex with a tint of 1."""
    sheet = sheet_of([plant], 256)
    (part,) = sheet.parts
    height, width = sheet.color.shape[:2]
    x, y = np.minimum(part.uvs.mean(axis=0) * (width, height), (width - 1, height - 1)).astype(int)
    assert part.colors is not None
    color = np.minimum(part.colors[0, :3] / BRIGHTEST, 1)
    return np.asarray(color * linear_from_srgb(sheet.color[y, x, :3] / 255))


@pytest.mark.parametrize("light", [0.05, 0.2, 0.5, 0.79])
def test_a_tint_of_1_shows_the_models_color(light: float) -> None:
    """With a picture and without."""
    srgb = round(255 * float(1.055 * light ** (1 / 2.4) - 0.055))
    pixels = np.full((4, 4, 4), (srgb, srgb, srgb, 255))
    np.testing.assert_allclose(
        shown(cards([0, 1, 0], 0.5, leaf(texture(pixels)))), light, rtol=0.03
    )
    np.testing.assert_allclose(
        shown(cards([0, 1, 0], 0.5, painted([light, light, light, 1]))), light, rtol=1e-9
    )


@pytest.mark.parametrize("pictured", [True, False])
def test_white_loses_what_tints_need(pictured: bool) -> None:
    """A plant of tint 1 is drawn at 1 / BRIGHTEST of its sheet, where white is white."""
    white = leaf(texture(np.full((4, 4, 4), 255))) if pictured else painted([1.0, 1, 1, 1])
    np.testing.assert_allclose(shown(cards([0, 1, 0], 0.5, white)), 1 / BRIGHTEST, rtol=0.02)


def test_an_opaque_picture_has_no_holes() -> None:
    bark = leaf(texture(np.full((4, 4, 4), (90, 60, 40, 0))), alpha_mode="opaque")
    sheet = sheet_of([cards([0, 1, 0], 0.5, bark)], 256)
    assert (texels(sheet, sheet.parts[0], (4, 4))[..., 3] >= 128).all()


@pytest.mark.parametrize(("cutoff", "visible"), [(0.2, True), (0.8, False)])
def test_a_picture_is_cut_off_where_its_material_says(cutoff: float, visible: bool) -> None:
    """Alpha of 0.4, and of 0.6."""
    alpha = 102 if visible else 153
    picture = texture(np.full((4, 4, 4), (90, 120, 40, alpha)))
    sheet = sheet_of([cards([0, 1, 0], 0.5, leaf(picture, alpha_cutoff=cutoff))], 256)
    part = sheet.parts[0]
    assert part.colors is not None
    kept = texels(sheet, part, (4, 4))[..., 3] / 255 * part.colors[0, 3] >= 0.5
    assert kept.all() if visible else not kept.any()


def test_levels_with_baked_light_are_not_lit_again() -> None:
    unlit = leaf(noise(4, 4), unlit=True)
    assert sheet_of([cards([0, 1, 0], 0.5, unlit)], 256).material("m").unlit


def test_baked_light_and_none_cannot_be_merged() -> None:
    one, other = (cards([0, 1, 0], 0.5, leaf(noise(4, 4), unlit=u)) for u in (True, False))
    with pytest.raises(UsageError, match="--prelit"):
        sheet_of([one, other], 256)
