"""A cartoon figure of about 1,000 triangles: a large round head, a body, limbs, eyes."""

from __future__ import annotations

from solids.shapes import ellipsoid, mirrored, plant_of, tube
from vegtool.plant import Plant

COLORS = {
    "skin": "#f2b66d",
    "shirt": "#2e8f8a",
    "trousers": "#4a4f8c",
    "shoes": "#5b3a29",
    "white": "#f6f4ee",
    "pupil": "#1d1b1a",
    "cap": "#c8442f",
}
SKIN, SHIRT, TROUSERS, SHOES, WHITE, PUPIL, CAP = range(len(COLORS))


def figure() -> Plant:
    """1.5 m tall; it looks along x, y is up."""
    left = [
        tube([(0, 0.78, 0.2), (0, 0.85, 0.25), (0.02, 0.7, 0.38), (0.1, 0.56, 0.44),
              (0.2, 0.47, 0.43), (0.22, 0.45, 0.43)],
             [0.075, 0.075, 0.06, 0.05], 6, SKIN, side=(1.0, 0.0, 0.0)),
        ellipsoid((0.25, 0.43, 0.42), (0.085, 0.07, 0.06), 3, 6, SKIN),
        tube([(0, 0.45, 0.12), (0, 0.4, 0.13), (0.01, 0.22, 0.14), (0, 0.06, 0.14),
              (0, 0.05, 0.14)],
             [0.12, 0.09, 0.075], 8, TROUSERS),
        ellipsoid((0.07, 0.05, 0.14), (0.16, 0.06, 0.08), 4, 8, SHOES),
        ellipsoid((0.22, 1.15, 0.1), (0.075, 0.1, 0.09), 4, 8, WHITE),
        ellipsoid((0.29, 1.14, 0.1), (0.018, 0.035, 0.03), 2, 6, PUPIL),
    ]  # fmt: skip
    middle = [
        tube([(0, 0.32, 0), (0, 0.36, 0), (0, 0.46, 0), (0.02, 0.56, 0), (0, 0.68, 0),
              (0, 0.8, 0), (0, 0.9, 0), (0, 0.93, 0)],
             [0.16, 0.25, 0.27, 0.25, 0.2, 0.12], 12, SHIRT, flat=0.95),
        ellipsoid((0, 1.12, 0), (0.26, 0.29, 0.25), 8, 12, SKIN),
        ellipsoid((0.29, 1.04, 0), (0.08, 0.055, 0.055), 3, 6, SKIN),
        tube([(-0.03, 1.22, 0), (-0.03, 1.26, 0), (-0.04, 1.34, 0), (-0.06, 1.42, 0),
              (-0.07, 1.45, 0)], [0.262, 0.235, 0.13], 10, CAP),
        ellipsoid((-0.07, 1.46, 0), (0.045, 0.045, 0.045), 3, 6, CAP),
    ]  # fmt: skip
    return plant_of(
        "figure", [*middle, *left, *(mirrored(piece) for piece in left)], COLORS, crease=70.0
    )
