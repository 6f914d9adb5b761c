"""Surfels in progressive order: oriented discs, any first part of which is a picture of the whole.

Brandt, Jähn, Fischer, Meyer auf der Heide: Rendering of complex heterogenous scenes using
progressive blue surfels (2019), sections 3 and 4.1.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray, checked


@dataclass(frozen=True)
class Spacing:
    """What prefix lengths follow from. length: points of the prefix measured, p_m, copies not
    counted. radius_m: median of the distances from each to the nearest other, r_m; zero where there
    is no other. total: points of the whole order."""

    length: int
    radius_m: float
    total: int

    def prefix(self, radius_m: float) -> int:
        """p(r): points of the shortest prefix that discs of a radius, metres, cover a surface with;
        from 1, or 0 where there are none, to all."""
        return int(self.prefixes(np.array([radius_m]))[0])

    def prefixes(self, radius_m: npt.ArrayLike) -> IntArray:
        """(n,) int32: the same for radii (n,)."""
        radius = np.asarray(radius_m, np.float64)
        most = (self.total / max(self.length, 1)) ** 0.5
        all_of_them = self.radius_m >= radius * most  # of radius 0 too, which nothing is divided by
        ratio = np.divide(self.radius_m, radius, out=np.zeros_like(radius), where=~all_of_them)
        some = np.clip(np.ceil(self.length * ratio**2), min(self.total, 1), self.total)
        return np.where(all_of_them, self.total, some).astype(np.int32)

    def radius(self, prefix: int) -> float:
        """Metres: of the discs that so many points, one or more, cover a surface with; p's
        inverse."""
        return float(self.radius_m * (self.length / prefix) ** 0.5)


@dataclass(frozen=True, eq=False)
class SurfelSet:
    """n surfels in progressive order.

    position: (n, 3) metres. normal: (n, 3) unit, to the side that was seen. color: (n, 3) linear.
    spacing: of their positions. covering: (k,) factors of the radii of discs, of prefixes of 1, 2,
    4, ... points, with which they cover as much of a picture as the surface does; beyond, the last
    one. unlit: colours are what is seen; clients add no light.
    """

    position: FloatArray
    normal: FloatArray
    color: FloatArray
    spacing: Spacing
    covering: FloatArray = field(default_factory=lambda: np.ones(1))
    unlit: bool = False

    def __post_init__(self) -> None:
        position = checked("SurfelSet.position", self.position, (None, 3), np.float64)
        object.__setattr__(self, "position", position)
        for name in ("normal", "color"):
            value = checked(f"SurfelSet.{name}", getattr(self, name), position.shape, np.float64)
            object.__setattr__(self, name, value)
        covering = checked("SurfelSet.covering", self.covering, (None,), np.float64)
        if not len(covering) or (covering <= 0).any():
            raise ValueError("SurfelSet.covering: expected factors above zero, one at least")
        object.__setattr__(self, "covering", covering)
        if self.spacing.total != len(position):
            raise ValueError(
                f"SurfelSet.spacing: expected that of {len(position)}; is of {self.spacing.total}"
            )

    def __len__(self) -> int:
        return len(self.position)

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) metres: least and greatest coordinates of positions."""
        return np.stack([self.position.min(axis=0), self.position.max(axis=0)])

    def first(self, count: int) -> SurfelSet:
        """The set of a prefix, `count` surfels or all."""
        return self.of(slice(count), replace(self.spacing, total=min(count, len(self))))

    def of(self, rows: slice | npt.NDArray[np.integer], spacing: Spacing) -> SurfelSet:
        """A set of some of them, in rising order, and its spacing."""
        return replace(
            self,
            position=self.position[rows],
            normal=self.normal[rows],
            color=self.color[rows],
            spacing=spacing,
        )

    def moved(self, shift: FloatArray) -> SurfelSet:
        """The set elsewhere, by (3,) metres."""
        return replace(self, position=self.position + shift)

    def factors(self, prefix: npt.ArrayLike) -> FloatArray:
        """(m,) factors of the radii of discs for prefixes (m,), each one or more."""
        step = np.log2(np.maximum(np.asarray(prefix, np.float64), 1.0))
        return np.interp(step, np.arange(len(self.covering)), self.covering)

    def discs(self, radius_m: npt.ArrayLike) -> tuple[IntArray, FloatArray]:
        """(m,) int32 how many surfels to draw where discs of radii (m,), metres, are small enough,
        and (m,) metres, the radii to draw them with: larger where there are no more surfels."""
        radius = np.asarray(radius_m, np.float64)
        prefix = self.spacing.prefixes(radius)
        least = self.spacing.radius(max(len(self), 1))
        return prefix, np.maximum(radius, least) * self.factors(prefix)
