"""The noise that reveals texels: even at every share and size, in arrays and as a GPU reads it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from cards import cards, texture
from instanced import coverage, facing, frame_of, instance, landscape_of, shifted

from vegtool.gl.landscape import Landscape
from vegtool.plant import Material
from vegtool.preview.reveal import (
    SIGMA,
    SIZE,
    SMALLEST,
    STARTED,
    interpolated,
    noise,
    threshold_of,
    void_and_cluster,
)
from vegtool.seeding import generator

SHARES = np.array([0.05, 0.1, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9, 0.95])


def energy_of(chosen: np.ndarray) -> np.ndarray:
    """How crowded each texel of a repeated square is, summed anew over all that are chosen."""
    size = len(chosen)
    rows, columns = np.mgrid[:size, :size]
    total = np.zeros((size, size))
    for row, column in zip(*np.nonzero(chosen), strict=True):
        down, right = np.abs(rows - row), np.abs(columns - column)
        square = np.minimum(down, size - down) ** 2 + np.minimum(right, size - right) ** 2
        total += np.exp(-square / (2 * SIGMA**2))
    return total


@pytest.mark.parametrize("size", [2, 8, 16])
def test_each_next_texel_fills_the_largest_void_and_each_last_leaves_the_tightest_cluster(
    size: int,
) -> None:
    """Ulichney's rules, for each rank by itself. To a rounding: where several are as good, any."""
    rank = void_and_cluster(size)
    assert sorted(rank.ravel()) == list(range(size * size))
    started = max(1, round(STARTED * size * size))
    for place in range(size * size):
        here = np.nonzero(rank == place)
        if place < started:
            kept = rank <= place
            energy = energy_of(kept)
            assert energy[here] >= energy[kept].max() - 1e-9
        else:
            energy = energy_of(rank < place)
            assert energy[here] <= energy[rank >= place].min() + 1e-9


def test_one_texel_is_first() -> None:
    assert void_and_cluster(1).tolist() == [[0]]


def test_all_values_are_as_frequent_at_every_size() -> None:
    levels = noise()
    assert [len(level) for level in levels] == [64, 32, 16, 8]
    assert len(levels[0]) == SIZE and len(levels[-1]) == SMALLEST
    for level in levels:
        found, count = np.unique(level, return_counts=True)
        assert (count == max(level.size // 256, 1)).all()
        assert int(found[0]) + int(found[-1]) in (255, 256), "as far from 0 as from all"
        assert not level.flags.writeable


def low_energy(values: np.ndarray) -> float:
    """Mean power of waves longer than eight texels."""
    power = np.abs(np.fft.fft2(values - values.mean())) ** 2 / values.size
    along = np.fft.fftfreq(len(values))
    waves = np.hypot(*np.meshgrid(along, along))
    return float(power[(waves > 0) & (waves < 1 / 8)].mean())


@pytest.mark.parametrize("level", [0, 1, 2])
def test_it_is_blue(level: int) -> None:
    """Of long waves it has less than a thousandth of what the same values have in any order; what
    is shown at each share a tenth, or a fifth of where there are hardly any."""
    values = noise()[level] / 255.0
    rng = generator(0, "white")
    white = [rng.permutation(values.ravel()).reshape(values.shape) for _ in range(20)]
    assert low_energy(values) < np.mean([low_energy(w) for w in white]) / 1000
    for share in SHARES:
        usual = np.mean([low_energy((w < share).astype(float)) for w in white])
        shown = low_energy((values < share).astype(float))
        assert shown < usual * (0.2 if min(share, 1 - share) < 0.08 else 0.1)


@pytest.mark.parametrize("level", [0, 1])
def test_it_has_no_seam(level: int) -> None:
    """Distances to the nearest of those shown first, the shorter way round: at the border as in
    the middle."""
    values = noise()[level]
    size = len(values)
    shown = np.argwhere(values < 26)
    away = np.abs(shown[:, None] - shown)
    away = np.hypot(*np.moveaxis(np.minimum(away, size - away), -1, 0))
    nearest = np.where(away == 0, np.inf, away).min(axis=1)
    border = ((shown < 3) | (shown >= size - 3)).any(axis=1)
    assert nearest.min() >= 2, "none are neighbours"
    assert abs(nearest[border].mean() - nearest[~border].mean()) < 0.3


def test_interpolated_is_what_a_bilinear_filter_reads() -> None:
    texels = generator(1, "texels").random((5, 5))
    places = 4
    found = interpolated(texels, places)
    for row, column in np.ndindex(found.shape):
        y, x = (row + 0.5) / places, (column + 0.5) / places
        top, left = int(y), int(x)
        v, u = y - top, x - left
        below, right = (top + 1) % 5, (left + 1) % 5
        above = (1 - u) * texels[top, left] + u * texels[top, right]
        under = (1 - u) * texels[below, left] + u * texels[below, right]
        assert found[row, column] == pytest.approx((1 - v) * above + v * under)


@pytest.mark.parametrize("level", [0, 1, 2, 3])
def test_below_the_threshold_lies_the_share(level: int) -> None:
    """At places other than those at which it was counted. The first level to two thousandths, the
    smallest, of 64 texels, to eleven."""
    values = interpolated(noise()[level] / 255.0, 13)
    bound = (0.002, 0.009, 0.009, 0.011)[level]
    for share, threshold in zip(SHARES, threshold_of(SHARES), strict=True):
        assert (values < threshold).mean() == pytest.approx(share, abs=bound)


def test_thresholds_rise_and_none_is_0_and_all_is_beyond_all_values() -> None:
    found = threshold_of(np.linspace(0, 1, 1001))
    assert (np.diff(found) >= 0).all()
    assert found[0] == 0 and found[-1] == 2
    assert threshold_of(np.array([-0.1, 1.1])).tolist() == [0, 2]
    assert 0 < found[1] < found[-2] < 1


# -- as a GPU reads it -----------------------------------------------------------------------------

TEXELS = (64, 128, 256, 512)
"""Along a side of a card that is PIXELS across: 2 pixels to a texel, up to 4 texels to a pixel."""
PIXELS = 128


def landscapes(soft: bool) -> Iterator[tuple[int, Landscape]]:
    for texels in TEXELS:
        picture = texture(np.full((texels, texels, 4), 255))
        leaf = Material("leaf", color_texture=picture, alpha_mode="mask", role="leaf")
        card = cards(np.zeros(3), 0.5, leaf)
        with landscape_of(card, noise=noise(), mipmaps=soft) as landscape:
            yield texels, landscape


def shares_shown(landscape: Landscape, shares: np.ndarray) -> list[float]:
    """Of the card, the mean over eight places in the grid of pixels."""
    rng = generator(2, "places")
    shots = [shifted(facing(PIXELS, 1.05), *rng.random(2)) for _ in range(8)]
    whole = sum(coverage(landscape, frame_of(instance()), shot).sum() for shot in shots)
    found = []
    for threshold in threshold_of(shares):
        frame = frame_of(instance(shown=threshold), fading=True)
        shown = sum(coverage(landscape, frame, shot).sum() for shot in shots)
        found.append(float(shown / whole))
    return found


@pytest.mark.gl
@pytest.mark.parametrize(("soft", "bound"), [(True, 0.03), (False, 0.011)])
def test_of_a_card_the_share_is_shown(soft: bool, bound: float) -> None:
    """soft: with edges tested at each sample, which carries the noise on in straight lines."""
    shares = np.array([0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95])
    for texels, landscape in landscapes(soft):
        found = shares_shown(landscape, shares)
        np.testing.assert_allclose(found, shares, atol=bound, err_msg=f"{texels} texels")


@pytest.mark.gl
@pytest.mark.parametrize("soft", [True, False])
def test_what_was_shown_stays(soft: bool) -> None:
    for _, landscape in landscapes(soft):
        before = np.zeros((PIXELS, PIXELS))
        for threshold in threshold_of(np.array([0.01, 0.1, 0.3, 0.5, 0.8, 0.97, 1.0])):
            frame = frame_of(instance(shown=threshold), fading=True)
            shown = coverage(landscape, frame, facing(PIXELS, 1.03))
            assert (shown >= before).all()
            before = shown
        np.testing.assert_array_equal(
            before, coverage(landscape, frame_of(instance()), facing(PIXELS, 1.03))
        )


@pytest.mark.gl
@pytest.mark.parametrize("soft", [True, False])
def test_none_are_none_and_all_are_all(soft: bool) -> None:
    for texels, landscape in landscapes(soft):
        assert shares_shown(landscape, np.array([0.0, 1.0])) == [0, 1], f"{texels} texels"


LEAF = Material(
    "leaf", color_texture=texture(np.full((8, 8, 4), 255)), alpha_mode="mask", role="leaf"
)


@pytest.mark.gl
@pytest.mark.parametrize("material", [Material("plain", role="leaf"), LEAF])
def test_by_pixels_each_share_is_shown(material: Material) -> None:
    """A card over two repetitions of the noise on each side, so that shares are those of values;
    to one of the 256."""
    with landscape_of(cards(np.zeros(3), 0.5, material), noise=noise(), pixels_fade=True) as both:
        for share in (0.0, 0.05, 0.25, 0.6, 0.95, 1.0):
            frame = frame_of(instance(shown=share), fading=True)
            assert coverage(both, frame, facing(128, 1.0)).mean() == pytest.approx(share, abs=0.005)


@pytest.mark.gl
@pytest.mark.parametrize("material", [Material("plain", role="leaf"), LEAF])
def test_by_pixels_one_level_shows_where_the_other_does_not(material: Material) -> None:
    """At shares that no value is, such as 0.6, which is 153 / 255."""
    with landscape_of(cards(np.zeros(3), 0.5, material), noise=noise(), pixels_fade=True) as both:
        for share in (0.051, 0.253, 0.601, 0.951):
            parts = [
                coverage(both, frame_of(instance(shown=shown), fading=True), facing(128, 1.0))
                for shown in (share, -share - 1e-6)
            ]
            np.testing.assert_array_equal(sum(parts), 1)
