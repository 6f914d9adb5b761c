"""sRGB and linear light."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.srgb import linear_from_srgb, srgb_from_linear


def test_known_values() -> None:
    light = np.array([0.0, 0.0031308, 0.2140411, 1.0])
    np.testing.assert_allclose(srgb_from_linear(light), [0, 0.04045, 0.5, 1], atol=1e-4)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_every_byte_survives_there_and_back(dtype: type) -> None:
    color = np.arange(256, dtype=dtype) / dtype(255)
    light = linear_from_srgb(color)
    assert light.dtype == dtype
    np.testing.assert_allclose(srgb_from_linear(light), color, atol=1e-6)


def test_values_that_no_byte_has_are_clipped() -> None:
    np.testing.assert_array_equal(linear_from_srgb(np.array([-0.5, 1.5])), [0.0, 1.0])
