"""Samples that are not plants, for the methods that the surfel papers measure on such models.

Both are grids whose resolution follows the number of triangles: a statue, which is a closed solid
of revolution with folds, a face and fine relief, and a patch of terrain.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.growth.mesh import closed_faces, grid_faces
from vegtool.growth.noise import octaves
from vegtool.plant import Material, Plant
from vegtool.seeding import generator

# Half the outline of a robed figure on a plinth: distance from the axis and height, metres.
OUTLINE = np.array(
    [
        (0.000, 0.000), (0.200, 0.000), (0.400, 0.000), (0.430, 0.030), (0.430, 0.130),
        (0.400, 0.160), (0.350, 0.180), (0.335, 0.260), (0.300, 0.420), (0.265, 0.620),
        (0.235, 0.840), (0.205, 1.020), (0.195, 1.120), (0.225, 1.260), (0.255, 1.400),
        (0.250, 1.490), (0.190, 1.550), (0.105, 1.585), (0.078, 1.620), (0.085, 1.660),
        (0.118, 1.720), (0.132, 1.790), (0.128, 1.860), (0.104, 1.925), (0.060, 1.968),
        (0.000, 1.985),
    ]
)  # fmt: skip
# Angle from the front in degrees, height, width (degrees, metres), how far out: metres.
FEATURES = (
    (0, 1.775, 8, 0.030, 0.030),  # nose
    (0, 1.845, 30, 0.022, 0.010),  # brow
    (22, 1.808, 9, 0.016, -0.016),  # eyes
    (-22, 1.808, 9, 0.016, -0.016),
    (0, 1.722, 15, 0.010, 0.010),  # lips
    (0, 1.672, 20, 0.018, 0.018),  # chin
    (180, 1.820, 45, 0.070, 0.045),  # hair
    (38, 1.240, 22, 0.110, 0.050),  # folded arms
    (-38, 1.240, 22, 0.110, 0.050),
    (0, 1.190, 20, 0.045, 0.060),  # hands
)
TERRAIN = 200.0  # metres, each way


def statue(triangles: int | None, seed: int) -> Plant:
    """A robed figure of 2 m: closed, each edge between two faces, outward normals."""
    count = triangles or 40_000
    columns = max(3, round(np.sqrt(count * 0.26)))
    rings = max(2, round(count / (2 * columns)))
    rng = generator(seed, "statue")
    radius, height = _outline(rings)
    angle = np.arange(columns) * (2 * np.pi / columns)
    theta, r = np.broadcast_arrays(angle[None, :], radius[:, None])
    y = np.broadcast_to(height[:, None], theta.shape)
    r = r + _relief(theta, r, y, rng)
    positions = np.stack([r * np.sin(theta) * 1.0, y, r * np.cos(theta) * 0.88], axis=-1)
    sway = 0.035 * np.sin(np.pi * np.clip((y - 0.16) / 1.8, 0, 1) * 1.5)
    positions[..., 0] += sway
    grain = 0.004 * octaves(positions.reshape(-1, 3) * 16, 3, 0.6, rng).reshape(theta.shape)
    outward = unit(np.stack([np.sin(theta), np.zeros_like(theta), np.cos(theta)], axis=-1))
    positions += (grain * np.clip(r / 0.05, 0, 1))[..., None] * outward
    bottom, top = positions[0, 0], positions[-1, 0]
    vertices = np.concatenate([[bottom], positions[1:-1].reshape(-1, 3), [top]])
    faces = closed_faces(len(radius) - 2, columns)
    v = np.concatenate([[0.0], np.repeat(np.linspace(0, 1, len(radius))[1:-1], columns), [1.0]])
    u = np.concatenate([[0.5], np.tile(angle / (2 * np.pi), len(radius) - 2), [0.5]])
    return Plant(
        name="statue",
        positions=vertices,
        normals=vertex_normals(vertices, faces),
        uvs=np.stack([u, 1 - v], axis=1),
        colors=_marble(vertices, rng),
        faces=faces,
        face_material=np.zeros(len(faces), np.int32),
        materials=(Material(name="marble", roughness=0.6),),
        source="sample statue",
    )


def _outline(rings: int) -> tuple[FloatArray, FloatArray]:
    """Radius and height of rings + 1 places evenly along the rounded outline, ends on the axis."""
    steps = np.linspace(0, len(OUTLINE) - 1, 2001)
    dense = np.stack([np.interp(steps, np.arange(len(OUTLINE)), c) for c in OUTLINE.T], axis=1)
    # Mirrored beyond the axis, so that rounding keeps the ends on it and smooth.
    mirror = np.array([-1.0, 1.0])
    wide = np.concatenate([dense[100:0:-1] * mirror, dense, dense[-2:-102:-1] * mirror])
    kernel = np.hanning(101)
    kernel /= kernel.sum()
    smooth = np.stack([np.convolve(c, kernel, "same")[100:-100] for c in wide.T], axis=1)
    smooth[[0, -1], 0] = 0.0
    length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(smooth, axis=0), axis=1))]
    at = np.linspace(0, length[-1], rings + 2)
    return np.interp(at, length, smooth[:, 0]), np.interp(at, length, smooth[:, 1])


def _relief(
    theta: FloatArray, r: FloatArray, y: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Folds of the robe, face and arms: metres outward, of the grid's shape."""
    robe = np.clip((y - 0.18) / 0.10, 0, 1) * np.clip((1.56 - y) / 0.25, 0, 1)
    hem = np.clip((1.3 - y) / 1.1, 0, 1)
    folds = np.zeros_like(y)
    for number, strength in ((7, 1.0), (11, 0.7), (17, 0.45)):
        phase, slant = rng.uniform(0, 2 * np.pi), rng.uniform(-1.6, 1.6)
        folds += strength * np.cos(number * theta + phase + slant * 2 * y + 0.6 * np.sin(4 * y))
    relief = 0.020 * robe * (0.35 + hem) * folds
    flutes = np.exp(-np.minimum(((y - 0.08) / 0.03) ** 2, 60.0)) * np.abs(np.cos(10 * theta))
    border = np.exp(-np.minimum(((y - 0.27) / 0.035) ** 2, 60.0))
    relief += 0.012 * flutes + 0.007 * border * np.cos(20 * theta) * np.cos(y * 90)
    for angle, height, wide, tall, out in FEATURES:
        turn = np.angle(np.exp(1j * (theta - np.radians(angle))))
        # On the axis a turn means nothing, so features fade out towards it.
        near = np.clip(r / 0.06, 0, 1)
        away = (turn / np.radians(wide)) ** 2 + ((y - height) / tall) ** 2
        relief = relief + near * out * np.exp(-np.minimum(away, 60.0))
    return np.asarray(relief)


def _marble(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    """(v, 4) linear colours: pale stone with grey veins."""
    veins = np.exp(-6.0 * np.abs(octaves(points * 2.5, 4, 0.55, rng)))
    cloud = octaves(points * 6.0, 2, 0.5, rng)
    stone = np.array([0.80, 0.77, 0.72]) * (1 + 0.05 * cloud[:, None])
    color = stone + (np.array([0.42, 0.42, 0.43]) - stone) * (0.7 * veins[:, None])
    return np.concatenate([np.clip(color, 0, 1), np.ones((len(points), 1))], axis=1)


def height_field(triangles: int | None, seed: int) -> Plant:
    """A hilly patch of terrain of 200 x 200 m, its middle at the origin."""
    count = triangles or 32_768
    rows = max(1, round(np.sqrt(count / 2)))
    columns = max(1, round(count / (2 * rows)))
    rng = generator(seed, "height-field")
    row, column = np.divmod(np.arange((rows + 1) * (columns + 1)), columns + 1)
    across, back = column / columns, row / rows
    ground = np.stack([across, back], axis=1)
    bent = ground + 0.04 * np.stack(
        [octaves(ground * 5, 2, 0.5, rng), octaves(ground * 5, 2, 0.5, rng)], axis=1
    )
    ridges = 1.0 - np.abs(octaves(bent * 1.5, 4, 0.35, rng))
    height = 20.0 * ridges**2 + 4.0 * octaves(ground * 3.0, 7, 0.45, rng)
    height -= height.mean()
    # Rows run away from a viewer who looks along -z, so that faces turn upward.
    positions = np.stack([(across - 0.5) * TERRAIN, height, (0.5 - back) * TERRAIN], axis=1)
    faces = grid_faces(rows, columns, pointed=False)
    normals = vertex_normals(positions, faces)
    return Plant(
        name="height-field",
        positions=positions,
        normals=normals,
        uvs=np.stack([across, 1 - back], axis=1),
        colors=_soil(positions, normals, rng),
        faces=faces,
        face_material=np.zeros(len(faces), np.int32),
        materials=(Material(name="ground", roughness=1.0),),
        source="sample height-field",
    )


def _soil(points: FloatArray, normals: FloatArray, rng: np.random.Generator) -> FloatArray:
    """(v, 4) linear colours: grass, drier on the heights, rock where it is steep."""
    patches = octaves(points[:, [0, 2]] / 12.0, 4, 0.6, rng)[:, None]
    high = np.clip((points[:, 1:2] + 4 * patches) / 22.0 + 0.4, 0, 1)
    grass = np.array([0.075, 0.14, 0.030]) + high * np.array([0.15, 0.085, 0.035])
    rock = np.array([0.24, 0.21, 0.175]) * (1 + 0.25 * patches)
    steep = np.clip((0.80 - normals[:, 1:2] + 0.06 * patches) / 0.10, 0, 1)
    color = grass * (1 + 0.2 * patches) * (1 - steep) + rock * steep
    return np.concatenate([np.clip(color, 0, 1), np.ones((len(points), 1))], axis=1)


def vertex_normals(positions: FloatArray, faces: IntArray) -> FloatArray:
    """(v, 3) unit: the sum of the area vectors of the faces around each vertex."""
    a, b, c = (positions[faces[:, corner]] for corner in range(3))
    area = np.cross(b - a, c - a)
    total = np.zeros_like(positions)
    for axis in range(3):
        for corner in range(3):
            total[:, axis] += np.bincount(faces[:, corner], area[:, axis], len(positions))
    return unit(total)


SOLIDS: dict[str, Callable[[int | None, int], Plant]] = {
    "statue": statue,
    "height-field": height_field,
}
