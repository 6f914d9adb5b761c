"""Small plants for the tests of this room, and a slow plain reference of the objective."""

from __future__ import annotations

import numpy as np

from vegtool.clustering import ClusterOptions
from vegtool.clustering.features import face_features, face_weights
from vegtool.plant import Branches, Plant


def cards(n: int, seed: int = 0, size: float = 0.1) -> np.ndarray:
    """(2 n, 3, 3) corners of n square cards, turned at random, in a ball of radius one."""
    random = np.random.default_rng(seed)
    center = random.normal(size=(n, 3))
    center *= random.random((n, 1)) ** (1 / 3) / np.linalg.norm(center, axis=1, keepdims=True)
    frame = np.linalg.qr(random.normal(size=(n, 3, 3)))[0]
    u, v = size * frame[:, 0], size * frame[:, 1]
    a, b, c, d = center - u - v, center + u - v, center + u + v, center - u + v
    return np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], axis=1).reshape(-1, 3, 3)


def random_branches(faces: int, count: int, trunks: int = 1, seed: int = 0) -> Branches:
    """`count` branches, each grown from an earlier one; faces hang on them in random order."""
    random = np.random.default_rng(seed)
    parent = np.array([-1 if b < trunks else random.integers(0, b) for b in range(count)])
    level = np.zeros(count, dtype=np.int32)
    for b in range(trunks, count):
        level[b] = level[parent[b]] + 1
    return Branches(random.integers(0, count, faces), parent, level, "generator")


def inertia(plant: Plant, labels: np.ndarray, weight: float, count: int) -> float:
    """Weighted squared distances of the faces to their cluster's mean, one cluster at a time."""
    points = face_features(plant, ClusterOptions(weight).orientation_scale(count))
    weights = face_weights(plant)
    total = 0.0
    for label in np.unique(labels):
        mine, mass = points[labels == label], weights[labels == label]
        mean = (mass[:, None] * mine).sum(axis=0) / mass.sum()
        total += float((mass * ((mine - mean) ** 2).sum(axis=1)).sum())
    return total


def same_partition(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether the labels differ by their names alone."""
    pairs = {(int(x), int(y)) for x, y in zip(a, b, strict=True)}
    return len(pairs) == len(set(a.tolist())) == len(set(b.tolist()))
