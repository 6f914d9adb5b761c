"""FLIP against flip-evaluator, pixel by pixel, and the properties that any such measure has."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import flip_evaluator
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from vegtool.arrays import FloatArray, SingleArray
from vegtool.formats import read_plant
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lod import Display
from vegtool.measure.background import over
from vegtool.measure.flip import BLOCK, STRIP, difference, perceived
from vegtool.measure.pictures import live, truth
from vegtool.measure.views import around, direction
from vegtool.plant import Plant
from vegtool.seeding import generator

TOLERANCE = 1e-5
"""Of an error of 0 to 1, per pixel. Both sides are float32."""
NEAR_NOTHING = 1e-4
"""Where pictures differ by nothing but rounding, whose powers of 0.7 and 0.5 FLIP takes."""


def flip(reference: SingleArray, test: SingleArray) -> SingleArray:
    return difference(perceived(reference), perceived(test))


def oracle(reference: SingleArray, test: SingleArray) -> FloatArray:
    pair = (np.ascontiguousarray(p) for p in (reference, test))
    found, *_ = flip_evaluator.evaluate(*pair, "LDR", inputsRGB=False, applyMagma=False)
    return np.asarray(found, np.float64).reshape(reference.shape[:2])


def pictures(kind: str, height: int, width: int) -> tuple[SingleArray, SingleArray]:
    """Two linear pictures, (height, width, 3)."""
    random = generator(1, kind, height, width)
    a, b = random.random((2, height, width, 3), np.float32)
    if kind == "black and white":
        return np.round(a), np.round(b)
    if kind == "smooth":
        a = gaussian_filter(a, (2, 2, 0))
        return a, np.clip(a + b / 10, 0, 1)
    return a, b


@pytest.mark.parametrize("kind", ["noise", "smooth", "black and white"])
@pytest.mark.parametrize(
    "size",
    [(5, 5), (3, 40), (40, 3), (BLOCK, BLOCK + 1), (2 * BLOCK - 1, 2 * BLOCK),
     (STRIP, STRIP + 1), (2 * STRIP + 1, 90)],
)  # fmt: skip
def test_agrees_with_flip_evaluator(kind: str, size: tuple[int, int]) -> None:
    a, b = pictures(kind, *size)
    found, expected = flip(a, b), oracle(a, b)
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE)
    assert found.mean() == pytest.approx(expected.mean(), abs=TOLERANCE)


@pytest.mark.parametrize("size", [(1, 1), (1, 2), (1, 30), (30, 1), (2, 2)])
def test_agrees_on_pictures_smaller_than_any_filter(size: tuple[int, int]) -> None:
    a, b = pictures("noise", *size)
    np.testing.assert_allclose(flip(a, b), oracle(a, b), rtol=0, atol=NEAR_NOTHING)


def rendered(plant: Plant, pixels: float) -> tuple[SingleArray, SingleArray]:
    """Truth and live picture of a plant so many pixels high, over the background, linear."""
    display = Display()
    distance = display.distance_m(pixels / plant.extent)
    camera = around(plant.positions, direction(30.0, 10.0), distance, display)
    with PlantBuffers(plant) as exact, PlantBuffers(plant, mipmaps=True) as mipmapped:
        return over(truth(exact, camera)), over(live(mipmapped, camera))


@pytest.mark.gl
@pytest.mark.parametrize("pixels", [150.0, 25.0])
def test_agrees_on_renders_of_a_sample(pixels: float) -> None:
    a, b = rendered(sample("bush"), pixels)
    np.testing.assert_allclose(flip(a, b), oracle(a, b), rtol=0, atol=NEAR_NOTHING)
    assert flip(a, b).mean() > 0.01


@pytest.mark.gl
@pytest.mark.models
@pytest.mark.parametrize("pixels", [400.0, 50.0])
def test_agrees_on_renders_of_real_plants(pixels: float, models: Path) -> None:
    for name in ("eztree_ash_small", "eztree_pine_medium"):
        a, b = rendered(read_plant(models / name / f"{name}.glb"), pixels)
        found, expected = flip(a, b), oracle(a, b)
        np.testing.assert_allclose(found, expected, rtol=0, atol=NEAR_NOTHING)
        assert found.mean() == pytest.approx(expected.mean(), abs=1e-6)


def test_a_picture_is_no_different_from_itself() -> None:
    a, _ = pictures("noise", 30, 40)
    assert not flip(a, a).any()


def test_green_and_blue_are_as_different_as_colours_can_be() -> None:
    """The paper scales its colour differences by theirs."""
    green, blue = np.eye(3, dtype=np.float32)[1:, None, None]
    assert flip(green, blue).item() == pytest.approx(1, abs=TOLERANCE)


def test_one_pixel_of_many_is_seen_around_it_and_nowhere_else() -> None:
    """The filters reach ten pixels."""
    a = np.full((60, 60, 3), 0.2, np.float32)
    b = a.copy()
    b[30, 30] = 0.9
    found = flip(a, b)
    assert found[30, 30] > 0.2
    assert not found[:20].any() and not found[:, 41:].any()


def test_does_not_depend_on_the_order_of_the_pair() -> None:
    a, b = pictures("smooth", 30, 40)
    np.testing.assert_array_equal(flip(a, b), flip(b, a))


def test_turns_with_the_pictures() -> None:
    a, b = pictures("smooth", 30, 40)
    for turned in (np.flipud, np.fliplr, lambda p: np.swapaxes(p, 0, 1)):
        found = flip(np.ascontiguousarray(turned(a)), np.ascontiguousarray(turned(b)))
        np.testing.assert_allclose(found, turned(flip(a, b)), rtol=0, atol=TOLERANCE)


def test_moves_with_what_is_pictured() -> None:
    """Three rows down and five columns right on a plain ground, across the bounds of blocks."""
    a, b = (np.pad(p, ((15, 15), (15, 15), (0, 0)), "constant", constant_values=0.3)
            for p in pictures("smooth", 20, 24))  # fmt: skip
    moved = flip(*(np.roll(p, (3, 5), axis=(0, 1)) for p in (a, b)))
    found, expected = moved[3:, 5:], flip(a, b)[:-3, :-5]
    differ = expected > 0.01
    np.testing.assert_allclose(found[differ], expected[differ], rtol=0, atol=TOLERANCE)
    # Around them the pictures differ by next to nothing, which is rounded as a product orders its
    # sums, and that depends on the place in a block and on the processor.
    np.testing.assert_allclose(found, expected, rtol=0, atol=NEAR_NOTHING)


def test_pairs_in_threads_get_the_bytes_they_get_alone() -> None:
    pairs = [pictures("noise", 90 + i, 120) for i in range(6)]
    with ThreadPoolExecutor(3) as pool:
        together = list(pool.map(lambda pair: flip(*pair), pairs))
    for pair, found in zip(pairs, together, strict=True):
        np.testing.assert_array_equal(found, flip(*pair))


def test_pictures_stay_as_they_were() -> None:
    a, b = pictures("noise", 20, 20)
    before = a.copy(), b.copy()
    flip(a, b)
    np.testing.assert_array_equal([a, b], before)
