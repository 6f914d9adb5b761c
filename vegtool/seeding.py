"""Random generators from the user's seed and a stable key: the same picture for any job count."""

from __future__ import annotations

import hashlib

import numpy as np


def generator(seed: int, *key: str | int) -> np.random.Generator:
    """A generator that depends on `seed` and `key` alone (method, level, tile x, tile y, ...)."""
    digest = hashlib.sha256(repr((seed, key)).encode()).digest()
    return np.random.Generator(np.random.PCG64(int.from_bytes(digest[:16], "little")))
