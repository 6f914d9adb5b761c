"""An airplane of 2,960 or of 22,814 triangles: a fuselage of revolution, wings, a tail, a canopy,
and a propeller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

from solids.shapes import Piece, ellipsoid, lofted, plant_of, tube
from vegtool.arrays import FloatArray
from vegtool.plant import Plant

COLORS = {
    "metal": "#b7bcc2",
    "wing": "#a6adb5",
    "paint": "#b5392c",
    "glass": "#27394d",
    "black": "#26262a",
}
METAL, WING, PAINT, GLASS, BLACK = range(len(COLORS))

FUSELAGE = np.array(
    [
        (0.00, 0.38), (0.03, 0.44), (0.10, 0.52), (0.20, 0.60), (0.32, 0.64), (0.45, 0.63),
        (0.58, 0.56), (0.72, 0.44), (0.85, 0.30), (0.95, 0.17), (1.00, 0.06),
    ]
)  # fmt: skip
"""From the nose back: share of the length, radius in metres."""
LENGTH = 8.6
"""Metres, of the fuselage."""
SPINNER = ((4.6, 0.36), (4.72, 0.34), (4.86, 0.27), (4.98, 0.16), (5.05, 0.07))
"""From the fuselage on: place along it, radius, metres."""
BLADE = (0.07, 0.13, 0.14, 0.11, 0.05)
"""From the hub on: half the width, metres."""


@dataclass(frozen=True)
class Detail:
    """Rings and points on each, of every part."""

    fuselage: tuple[int, int]
    wing: tuple[int, int]
    tail: tuple[int, int]
    fin: tuple[int, int]
    canopy: tuple[int, int]
    spinner: tuple[int, int]
    blade: tuple[int, int]

    @property
    def triangles(self) -> int:
        each = {name: 2 * rings * points for name, (rings, points) in vars(self).items()}
        return sum(each.values()) + (BLADES - 1) * each["blade"]


BLADES = 3
COARSE = Detail((30, 24), (17, 16), (9, 12), (6, 12), (8, 16), (5, 12), (5, 8))
"""2,960 triangles."""
FINE = Detail((78, 64), (51, 46), (29, 32), (19, 32), (26, 44), (15, 31), (14, 22))
"""22,814 triangles."""


def airplane(detail: Detail = COARSE) -> Plant:
    """9.5 m long, 11 m wide; it flies along x, y is up."""
    return plant_of(
        "airplane",
        [
            fuselage(*detail.fuselage),
            wing(
                [(-5.5, 3.9, 0.75, 0.42), (-5.2, 3.75, 1.1, 0.4), (0.0, 3.0, 2.4, 0.0),
                 (5.2, 3.75, 1.1, 0.4), (5.5, 3.9, 0.75, 0.42)],
                -0.35, 0.13, *detail.wing,
            ),
            wing(
                [(-1.9, 8.05, 0.55, 0.0), (0.0, 7.6, 1.15, 0.0), (1.9, 8.05, 0.55, 0.0)],
                0.12, 0.1, *detail.tail,
            ),
            fin(*detail.fin),
            ellipsoid((4.6 - 3.3, 0.52, 0.0), (1.25, 0.42, 0.33), *detail.canopy, GLASS),
            spinner(*detail.spinner),
            *(blade(2 * np.pi * n / BLADES, *detail.blade) for n in range(BLADES)),
        ],
        COLORS,
        crease=40.0,
    )  # fmt: skip


def fuselage(rings: int, columns: int) -> Piece:
    """Somewhat higher than wide."""
    share = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, rings))
    radius = np.interp(share, *FUSELAGE.T)
    at = 4.6 - LENGTH * np.concatenate([[0.0], share, [1.0]])
    path = np.stack([at, np.zeros_like(at), np.zeros_like(at)], axis=1)
    return tube(path, radius, columns, METAL, flat=0.82)


def spinner(rings: int, columns: int) -> Piece:
    """Of the propeller, round."""
    share = np.linspace(0.0, 1.0, rings)
    along = smooth(share, SPINNER)
    path = np.zeros((rings + 2, 3))
    path[:, 0] = [4.55, *along[:, 0], 5.07]
    return tube(path, along[:, 1], columns, PAINT)


def smooth(share: FloatArray, through: npt.ArrayLike) -> FloatArray:
    """At shares of the way, on a curve through evenly numbered places."""
    places = np.asarray(through, dtype=np.float64)
    return PchipInterpolator(np.linspace(0.0, 1.0, len(places)), places)(share)


def section(points: int) -> FloatArray:
    """(points, 2) of a wing's outline: share of the chord, and half its thickness, from the
    trailing edge under the lower side to the leading edge and back."""
    turn = 2 * np.pi * np.arange(points) / points
    chord = 0.5 + 0.5 * np.cos(turn)
    return np.stack([chord, -np.sin(turn) * np.sqrt(1.0 - 0.75 * chord)], axis=1)


def wing(
    plan: Sequence[tuple[float, float, float, float]],
    height: float,
    thick: float,
    rings: int,
    points: int,
) -> Piece:
    """From tip to tip. plan: place across, of its leading edge behind the nose, chord, and how much
    it rises, metres. thick: of the chord."""
    place, lead, chord, rise = np.array(plan).T
    across = np.linspace(place[0], place[-1], rings)
    lead, chord, rise = (np.interp(across, place, of) for of in (lead, chord, rise))
    along, up = section(points).T
    x = 4.6 - (lead[:, None] + chord[:, None] * along)
    y = height + rise[:, None] + 0.5 * thick * chord[:, None] * up
    return _closed(np.stack([x, y, np.broadcast_to(across[:, None], x.shape)], axis=-1), WING)


def fin(rings: int, points: int) -> Piece:
    """Upright at the tail."""
    up = np.linspace(0.0, 1.0, rings)
    lead, chord = 7.2 + 0.75 * up, 1.45 - 0.85 * up
    along, side = section(points).T
    x = 4.6 - (lead[:, None] + chord[:, None] * along)
    z = -0.055 * chord[:, None] * side
    y = np.broadcast_to(0.05 + 1.35 * up[:, None], x.shape)
    return _closed(np.stack([x, y, z], axis=-1), PAINT)


def blade(turn: float, rings: int, points: int) -> Piece:
    """Of the propeller, twisted."""
    out = np.linspace(0.15, 1.55, rings)
    half = smooth(np.linspace(0.0, 1.0, rings), BLADE)
    pitch = np.radians(np.linspace(60.0, 20.0, rings))
    around = 2 * np.pi * np.arange(points) / points
    wide, thin = half[:, None] * np.cos(around), 0.2 * half[:, None] * np.sin(around)
    across = np.cos(pitch)[:, None] * wide - np.sin(pitch)[:, None] * thin
    x = 4.72 + np.sin(pitch)[:, None] * wide + np.cos(pitch)[:, None] * thin
    radial, sideways = (np.array([0, np.cos(turn + a), np.sin(turn + a)]) for a in (0, np.pi / 2))
    rings = out[:, None, None] * radial + across[..., None] * sideways
    rings[..., 0] = x
    return _closed(rings, BLACK)


def _closed(rings: FloatArray, material: int) -> Piece:
    return lofted(rings[0].mean(axis=0), rings, rings[-1].mean(axis=0), material)
