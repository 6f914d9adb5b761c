"""Surfels of a group of things, out of the surfels of each.

Brandt, Jähn, Fischer, Meyer auf der Heide: Rendering of complex heterogenous scenes using
progressive blue surfels (2019), section 3.4: bottom-up, from children's surfels in place of
geometry. What is seen of them from the eight corners of the group's bounds, as in section 3.1, are
the candidates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray, checked, unit
from vegtool.gl.point_ids import seen_discs
from vegtool.measure.views import upright
from vegtool.surfel_set import ALL_LIGHT, SurfelSet
from vegtool.surfels.blue import distances
from vegtool.surfels.blue.farthest import farthest_order
from vegtool.surfels.blue.places import drawn

FLATTEST = 0.5
"""Of the longest side of the bounds, which none counts as less than: flat groups, as squares of a
landscape are, are looked at from 19 degrees above their border at least."""
PIXELS_OF_ROOT = 1.4
"""Along a side of the picture, for the root of the number of discs."""
SMALLEST_M = 1e-9
"""Radius of discs: none counts as less."""
RESOLUTION = (64, 2048)
"""Pixels along a side, at least and at most."""
MEANT, LEAST = 8, 16_384
"""Discs for each surfel of a prefix, and of all of it at least, of which colours and normals are
means."""
PLACES = 20_000
"""Candidates at most, at which the error is looked at."""
FAR = 0.95
"""Share of them that are no farther from a surfel than is said."""


@dataclass(frozen=True, eq=False)
class Discs:
    """n surfels that cover what they are of. position: (n, 3) metres. normal: (n, 3) unit. color:
    (n, 3) linear. radius: (n,) metres. size: (n,) as of SurfelSet, which radii are times already
    and a group's surfels keep. light: (n, 3) as of SurfelSet, or None, and transmission_tint, (3,).
    """

    position: FloatArray
    normal: FloatArray
    color: FloatArray
    radius: FloatArray
    size: FloatArray
    light: FloatArray | None = None
    transmission_tint: FloatArray = field(default_factory=lambda: np.ones(3))

    def __post_init__(self) -> None:
        position = checked("Discs.position", self.position, (None, 3), np.float64)
        object.__setattr__(self, "position", position)
        for name, shape in (("normal", (len(position), 3)), ("color", (len(position), 3)),
                            ("radius", (len(position),)), ("size", (len(position),))):  # fmt: skip
            value = checked(f"Discs.{name}", getattr(self, name), shape, np.float64)
            object.__setattr__(self, name, value)
        if self.light is not None:
            light = checked("Discs.light", self.light, position.shape, np.float64)
            object.__setattr__(self, "light", light)

    def __len__(self) -> int:
        return len(self.position)

    def of(self, rows: npt.NDArray[np.bool_]) -> Discs:
        """Some of them."""
        return Discs(
            self.position[rows], self.normal[rows], self.color[rows], self.radius[rows],
            self.size[rows], None if self.light is None else self.light[rows],
            self.transmission_tint,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Group:
    """surfels: of a group. candidates: of how many. error_m: metres, no more than which FAR of them
    are from the nearest surfel."""

    surfels: SurfelSet
    candidates: int
    error_m: float


def discs_of(surfels: SurfelSet) -> Discs:
    """All of a set, as large as they are drawn where there are no more."""
    _, radius = surfels.discs(np.zeros(1))
    return Discs(
        surfels.position, surfels.normal, surfels.color, radius[0] * surfels.size, surfels.size,
        surfels.light, surfels.transmission_tint,
    )  # fmt: skip


def together(some: Sequence[Discs]) -> Discs:
    """All discs of several, one at least, in order. Their tint is the mean of theirs, by how much
    light passes through each."""
    every = Discs(
        *(np.concatenate([getattr(one, name) for one in some])
          for name in ("position", "normal", "color", "radius", "size"))
    )  # fmt: skip
    if all(one.light is None for one in some):
        return every
    lights = [np.tile(ALL_LIGHT, (len(one), 1)) if one.light is None else one.light for one in some]
    passing = np.array(
        [light[:, 2] @ one.radius**2 for one, light in zip(some, lights, strict=True)]
    )
    tint = np.ones(3)
    if passing.sum() > 0:
        tint = passing @ np.array([one.transmission_tint for one in some]) / passing.sum()
    return replace(every, light=np.concatenate(lights), transmission_tint=tint)


def outside(discs: Discs) -> npt.NDArray[np.bool_]:
    """(n,) which discs are seen from outside: from a corner of their bounds. One at least is.

    Raises CapabilityError where nothing can draw.
    """
    if not len(discs):
        return np.zeros(0, np.bool_)
    half = np.ptp(discs.position, axis=0) / 2
    half = np.maximum(half, FLATTEST * (float(half.max()) or 1.0))
    corners = np.array(list(product((-1.0, 1.0), repeat=3))) * half / np.linalg.norm(half)
    axes = np.array([np.stack([*upright(corner), corner]) for corner in corners])
    resolution = int(np.clip(PIXELS_OF_ROOT * len(discs) ** 0.5, *RESOLUTION))
    return seen_discs(discs.position, discs.normal, discs.radius, axes, resolution)


def grouped(
    discs: Discs, count: int, *, seed: int = 0, unlit: bool = False, double_sided: bool = True
) -> Group:
    """At most `count` surfels of a group, of which there is a disc at least; no more than are seen.

    Raises UsageError for a negative count, CapabilityError where nothing can draw.
    """
    from scipy.spatial import cKDTree

    seen = discs.of(outside(discs))
    order = farthest_order(seen.position, count, seed=seed)
    color, normal, light = _means(seen, order)
    position = seen.position[order]
    surfels = SurfelSet(
        position, normal, color, distances.spacing(position), seen.size[order], unlit, double_sided,
        None if unlit else light, seen.transmission_tint,
    )  # fmt: skip
    error = 0.0
    if 0 < len(surfels) < len(seen):
        some = seen.position[:: max(len(seen) // PLACES, 1)]
        error = float(np.quantile(cKDTree(surfels.position).query(some)[0], FAR))
    return Group(surfels, len(seen), error)


def _means(seen: Discs, order: IntArray) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """(k, 3) colours, (k, 3) unit normals and (k, 3) light, or None, of those in order: as of
    averaged.py, but of prefixes of all lengths, as from afar a surfel stands for many leaves, each
    with a light of its own. What is larger counts for more."""
    from scipy.spatial import cKDTree

    area = np.maximum(seen.radius, 1e-9 * float(seen.radius.max()) or 1.0)[:, None] ** 2
    values = np.hstack([seen.color, seen.normal, *(() if seen.light is None else (seen.light,))])
    result, weighed = values[order], np.hstack([values * area, area])
    length = 1 << (len(order) - 1).bit_length() if len(order) else 0
    while length > 0:  # the longest first, as the shortest is to count
        prefix = order[:length]
        some = drawn(len(seen), min(max(MEANT * length, LEAST), len(seen)), length)
        of = cKDTree(seen.position[prefix]).query(seen.position[some])[1]
        sums = np.stack(
            [np.bincount(of, column, len(prefix)) for column in weighed[some].T], axis=1
        )
        meant = sums[:, -1] > 0
        result[: len(prefix)][meant] = sums[meant, :-1] / sums[meant, -1:]
        length //= 2
    normal = unit(result[:, 3:6])
    flat = (normal == 0).all(axis=1)  # of opposite sides alike
    normal[flat] = seen.normal[order][flat]
    return result[:, :3], normal, None if seen.light is None else result[:, 6:]
