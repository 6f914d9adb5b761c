"""Light in the files of others: unlit materials, and light that passes through a leaf."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made import QUAD_UV, Gltf, png

from vegtool.formats import read_plant
from vegtool.plant import Material

UNLIT, TRANSMISSION = "KHR_materials_unlit", "KHR_materials_diffuse_transmission"
UP_NORMALS = np.tile(np.array([0, 0, 1], np.float32), (4, 1))
GRAY, WHITE = np.full((4, 4, 3), 188, np.uint8), np.full((2, 2, 3), 255, np.uint8)
LINEAR_GRAY = 0.5029
"""Of 188 / 255, by the definition of sRGB."""


class Leaf:
    """A leaf card in the making: its textures, then its material."""

    def __init__(self) -> None:
        self.made = Gltf()

    def texture(self, pixels: np.ndarray) -> dict[str, int]:
        return {"index": self.made.image(png(pixels))}

    def read(
        self, folder: Path, surface: dict[str, Any], **extensions: dict[str, Any]
    ) -> tuple[Material, tuple[str, ...]]:
        """The material that is read, and the notes. The file requires its extensions."""
        entry = self.made.material(
            name="leaf", pbrMetallicRoughness=surface, extensions=dict(extensions)
        )
        self.made.json["extensionsUsed"] = list(extensions)
        self.made.json["extensionsRequired"] = list(extensions)
        self.made.node(mesh=self.made.mesh(material=entry, TEXCOORD_0=QUAD_UV, NORMAL=UP_NORMALS))
        plant = read_plant(self.made.write(folder / "leaf.glb"))
        return plant.materials[0], plant.notes


def through(**values: Any) -> dict[str, dict[str, Any]]:
    names = {"factor": "Factor", "texture": "Texture", "color": "ColorFactor"}
    names["colors"] = "ColorTexture"
    return {TRANSMISSION: {f"diffuseTransmission{names[k]}": v for k, v in values.items()}}


def test_light_passes_through_no_material_unless_its_file_says_so(tmp_path: Path) -> None:
    material, notes = Leaf().read(tmp_path, {})
    assert (material.transmission, material.unlit, notes) == (0.0, False, ())
    assert material.transmission_tint.tolist() == [1, 1, 1]
    material, notes = Leaf().read(tmp_path, {}, **through(color=[0.1, 0.2, 0.3]))
    assert (material.transmission, notes) == (0.0, ()), "the factor is 0 by default"
    assert material.transmission_tint.tolist() == [1, 1, 1]


def test_unlit_is_read_and_leaves_nothing_to_pass_through(tmp_path: Path) -> None:
    material, notes = Leaf().read(tmp_path, {}, **{UNLIT: {}}, **through(factor=0.5))
    assert (material.unlit, material.transmission, notes) == (True, 0.0, ())


def test_where_both_sides_show_one_image_the_tint_is_the_ratio_of_factors(tmp_path: Path) -> None:
    leaf = Leaf()
    info = leaf.texture(GRAY)
    surface = {"baseColorFactor": [0.5, 0.8, 0.2, 1], "baseColorTexture": info}
    material, notes = leaf.read(
        tmp_path, surface, **through(factor=0.6, color=[0.6, 0.8, 0.1], colors=info)
    )
    assert material.transmission == 0.6
    assert np.allclose(material.transmission_tint, [1.2, 1, 0.5])
    assert notes == ()


def test_without_textures_it_is_the_ratio_of_factors_but_black_stays_black(tmp_path: Path) -> None:
    surface = {"baseColorFactor": [0.5, 0.8, 0, 1]}
    material, notes = Leaf().read(tmp_path, surface, **through(factor=0.6, color=[0.6, 0.8, 0.1]))
    assert np.allclose(material.transmission_tint, [1.2, 1, 1])
    assert notes == ()


@pytest.mark.parametrize("colored", [False, True])
def test_another_texture_is_taken_for_the_ratio_of_linear_means(
    tmp_path: Path, colored: bool
) -> None:
    """White, or no texture, over a grey that is half of white in linear light."""
    leaf = Leaf()
    surface = {"baseColorFactor": [1, 0.5, 0.1, 1], "baseColorTexture": leaf.texture(GRAY)}
    more = {"colors": leaf.texture(WHITE)} if colored else {}
    material, notes = leaf.read(
        tmp_path, surface, **through(factor=0.5, color=[0.5, 0.5, 1], **more)
    )
    expected = np.array([0.5, 1.0, 4 * LINEAR_GRAY]) / LINEAR_GRAY  # the last, of 19.9, is clipped
    assert np.allclose(material.transmission_tint, expected, rtol=1e-3)
    assert [n for n in notes if n.startswith("material leaf: light that passes through")]


def test_shares_in_a_texture_become_their_mean(tmp_path: Path) -> None:
    """A quarter of the texels lets all through, the others nothing: alpha, not brightness."""
    leaf, pixels = Leaf(), np.full((4, 4, 4), 255, np.uint8)
    pixels[..., 3] = 0
    pixels[:2, :2, 3] = 255
    material, notes = leaf.read(tmp_path, {}, **through(factor=0.8, texture=leaf.texture(pixels)))
    assert material.transmission == pytest.approx(0.2)
    assert notes == (
        "material leaf: how much light passes through is a texture; its mean, 0.2, is taken",
    )


def test_a_share_beyond_all_is_all(tmp_path: Path) -> None:
    assert Leaf().read(tmp_path, {}, **through(factor=1.5))[0].transmission == 1.0


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"factor": "much"}, 'a number as diffuseTransmissionFactor, found "much"'),
        ({"factor": [1]}, "a number as diffuseTransmissionFactor, found [1]"),
        ({"factor": True}, "a number as diffuseTransmissionFactor, found true"),
        ({"factor": None}, "a number as diffuseTransmissionFactor, found null"),
        ({"factor": float("nan")}, "a number as diffuseTransmissionFactor, found NaN"),
        ({"factor": 10**400}, "a number as diffuseTransmissionFactor, found 1000"),
        ({"color": None}, "3 numbers as diffuseTransmissionColorFactor, found null"),
        ({"color": [1, 1]}, "3 numbers as diffuseTransmissionColorFactor, found [1, 1]"),
        ({"color": 1}, "3 numbers as diffuseTransmissionColorFactor, found 1"),
        (
            {"color": [1, 1, float("inf")]},
            "3 numbers as diffuseTransmissionColorFactor, found [1, 1, Infinity]",
        ),
        (
            {"colors": None},
            "one of the file's textures as diffuseTransmissionColorTexture, found null",
        ),
        ({"texture": {}}, "one of the file's textures as diffuseTransmissionTexture, found {}"),
        (
            {"texture": {"index": 7}},
            'one of the file\'s textures as diffuseTransmissionTexture, found {"index": 7}',
        ),
    ],
)
def test_values_of_other_kinds_leave_the_extension_out(
    tmp_path: Path, values: dict[str, Any], says: str
) -> None:
    """The plant without light that passes through is still the plant."""
    material, (note,) = Leaf().read(tmp_path, {}, **through(**{"factor": 0.5, **values}))
    assert material.transmission == 0.0
    assert material.transmission_tint.tolist() == [1, 1, 1]
    assert note.startswith(f"material leaf: {TRANSMISSION} is left out: expected {says}")


def test_where_a_texture_of_shares_lies_does_not_matter(tmp_path: Path) -> None:
    """Its mean is taken: coordinates that make no sense refuse nothing."""
    leaf = Leaf()
    info = {**leaf.texture(WHITE), "texCoord": None, "extensions": {"KHR_texture_transform": []}}
    material, notes = leaf.read(tmp_path, {}, **through(factor=0.5, texture=info))
    assert (material.transmission, len(notes)) == (0.5, 1)


def test_an_extension_that_is_no_object_is_left_out(tmp_path: Path) -> None:
    material, (note,) = Leaf().read(tmp_path, {}, **{TRANSMISSION: None})  # type: ignore[arg-type]
    assert material.transmission == 0.0
    assert note.endswith("is left out: expected an object, found null")


@pytest.mark.parametrize("textured", [False, True])
def test_a_surface_that_is_nearly_black_is_tinted_no_more_than_can_be_meant(
    tmp_path: Path, textured: bool
) -> None:
    """1 over 0.001 would be a thousand times the colour, which no picture of levels can hold."""
    leaf = Leaf()
    info = {"baseColorTexture": leaf.texture(GRAY)} if textured else {}
    more = {"colors": info["baseColorTexture"]} if textured else {}
    material, (note,) = leaf.read(
        tmp_path,
        {"baseColorFactor": [1e-3, 0.5, 1, 1], **info},
        **through(factor=0.5, color=[1, 0.5, 0.5], **more),
    )
    assert np.allclose(material.transmission_tint, [4, 1, 0.5])
    assert note == (
        "material leaf: light that passes through is too bright; it is coloured as the surface, "
        "times (4, 1, 0.5); (1e+03, 1, 0.5) would be brighter than a file can hold, or than can be "
        "meant"
    )


def test_a_ratio_of_means_is_no_brighter_than_a_file_can_hold(tmp_path: Path) -> None:
    """White over grey is twice as bright: as factor of the surface's own texture, at most 1."""
    leaf = Leaf()
    surface = {"baseColorFactor": [1, 0.8, 0.4, 1], "baseColorTexture": leaf.texture(GRAY)}
    material, (note,) = leaf.read(tmp_path, surface, **through(factor=0.5))
    assert np.allclose(material.transmission_tint, [1, 1.25, 2.5])
    assert "the ratio of means; (2, 2.5, 5) would be brighter than" in note
