"""Ambient occlusion: what lies inside is darker than what lies outside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vegtool.growth import sample
from vegtool.plant import Material, Plant
from vegtool.refine.occlusion import occluded, open_shares


def shells(layers: int) -> Plant:
    """A ball of small square leaves on concentric spheres, evenly spread, all alike."""
    count = 600
    i = np.arange(count) + 0.5
    z, turn = 1 - 2 * i / count, np.pi * i * (1 + 5**0.5)
    r = np.sqrt(1 - z * z)
    out = np.stack([r * np.cos(turn), z, r * np.sin(turn)], axis=1)
    across = np.cross(out, [0.3, 0.5, 0.8])
    across /= np.linalg.norm(across, axis=1)[:, None]
    up = np.cross(out, across)
    positions, normals = [], []
    for layer in range(1, layers + 1):
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            positions.append(layer / layers * out + 0.06 * (a * across + b * up))
            normals.append(out)
    at = np.stack(positions, 1).reshape(-1, 3)
    first = 4 * np.arange(len(at) // 4, dtype=np.int32)
    faces = (first[:, None] + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
    return Plant(
        "ball",
        at,
        np.stack(normals, 1).reshape(-1, 3),
        np.zeros((len(at), 2)),
        faces.astype(np.int32),
        np.zeros(len(faces), np.int32),
        (Material("leaf", double_sided=True, role="leaf"),),
    )


def test_the_inside_is_darker_than_the_outside() -> None:
    ball = shells(4)
    shares = open_shares(ball)
    distance = np.linalg.norm(ball.face_centroids, axis=1)
    rings = [shares[np.abs(distance - r) < 0.1].mean() for r in (0.25, 0.5, 0.75, 1.0)]
    assert np.all(np.diff(rings) > 0)
    assert 0.4 < rings[-1] < 0.6  # half of all directions lead away from the ball


def test_nothing_hides_a_leaf_alone() -> None:
    ball = shells(1)
    leaf = replace(ball, faces=ball.faces[:2], face_material=ball.face_material[:2])
    assert np.allclose(open_shares(leaf), 1.0)


def test_strength_is_a_share_of_it_and_none_changes_nothing() -> None:
    ball = shells(3)
    assert occluded(ball, 0.0) is ball
    half, full = occluded(ball, 0.5).colors, occluded(ball, 1.0).colors
    assert half is not None
    assert full is not None
    assert np.allclose(half[:, :3], (1 + full[:, :3]) / 2)
    assert (full[:, 3] == 1).all()
    assert full.min() >= 0
    assert ball.colors is None


def test_it_does_not_matter_where_a_plant_stands_and_how_large_it_is() -> None:
    plant = sample("conifer")
    there = replace(plant, positions=7.0 * plant.positions + [30.0, 2.0, -11.0])
    assert np.allclose(open_shares(plant), open_shares(there), atol=1e-6)
