"""Light in the files of others: unlit materials, and light that passes through a leaf."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made import QUAD_UV, Gltf, png

from vegtool.errors import InputError
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


@pytest.mark.parametrize("value", ["much", [1], None])
def test_a_share_that_is_no_number_is_refused(tmp_path: Path, value: Any) -> None:
    with pytest.raises(InputError):
        Leaf().read(tmp_path, {}, **through(factor=value))
