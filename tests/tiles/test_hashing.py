"""The hash: splitmix64 as published, in plain integers beside ours in arrays."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vegtool.tiles.hashing import draws, hashes, key


def splitmix64(state: int, count: int) -> list[int]:
    """The generator as Steele, Lea and Flood write it down, one number after the other."""
    found = []
    for _ in range(count):
        state = (state + 0x9E3779B97F4A7C15) % 2**64
        z = state
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 % 2**64
        z = (z ^ (z >> 27)) * 0x94D049BB133111EB % 2**64
        found.append(z ^ (z >> 31))
    return found


def test_a_known_sequence() -> None:
    """The test vector that implementations of splitmix64 share."""
    known = [6457827717110365317, 3203168211198807973, 9817491932198370423]
    assert splitmix64(1234567, 3) == known
    assert hashes(1234567, np.arange(3)).tolist() == known


@settings(max_examples=30)
@given(st.integers(0, 2**64 - 1))
def test_arrays_give_what_integers_give(state: int) -> None:
    assert hashes(state, np.arange(5)).tolist() == splitmix64(state, 5)
    assert hashes(np.array([state], np.uint64), np.array([4])).tolist() == splitmix64(state, 5)[4:]
    found = draws(np.array([state], np.uint64), 3)[:, 0].tolist()
    assert found == [(number >> 11) / 2**53 for number in splitmix64(state, 3)]


@settings(max_examples=30)
@given(st.integers(0, 2**40), st.integers(-(2**40), 2**40), st.integers(-(2**40), 2**40))
def test_a_key_depends_on_each_number_and_their_order(seed: int, x: int, z: int) -> None:
    (state,) = splitmix64(seed, 1)
    for number in (x, z):
        (state,) = splitmix64(state ^ number % 2**64, 1)
    assert key(seed, x, z) == state
    if x != z:
        assert key(seed, x, z) != key(seed, z, x)
    assert len({key(seed, x), key(seed + 1, x), key(seed, x + 1), key(seed, x, 0)}) == 4


def test_draws_fill_the_unit_interval_evenly() -> None:
    """64,000 numbers in 64 bins: chi-squared has 63 degrees of freedom, 63 +- 11."""
    found = draws(hashes(7, np.arange(16_000)), 4)
    assert found.min() >= 0 and found.max() < 1
    counts = np.bincount((found.ravel() * 64).astype(int), minlength=64)
    assert ((counts - 1000) ** 2 / 1000).sum() < 63 + 5 * 11.2
    assert abs(np.corrcoef(found) - np.eye(4)).max() < 5 / np.sqrt(16_000)
