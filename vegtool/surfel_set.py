"""Surfels in progressive order: oriented discs, any first part of which is a picture of the whole.

Brandt, Jähn, Fischer, Meyer auf der Heide: Rendering of complex heterogenous scenes using
progressive blue surfels (2019), sections 3 and 4.1.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray, checked

ALL_LIGHT = (1.0, 1.0, 0.0)
"""The light of surfels of which nothing is known: all of the sky's, and none that passes
through."""


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
    spacing: of their positions. size: (n,), or (1,) for all, 0 to 1: of the radius that discs
    of a prefix have, with which each covers no more than what it stands for. unlit: colours are
    what is seen; clients add no light. double_sided: seen from behind, normals turn round, as on
    leaves; otherwise a surfel stands for what is before it, of something solid.
    light: (n, 3), 0 to 1: how much of the sky's light reaches the side of the normal and the
    other, and how much light passes through, in the colour times transmission_tint, (3,). Or None
    where all does and none passes, and of unlit ones.
    """

    position: FloatArray
    normal: FloatArray
    color: FloatArray
    spacing: Spacing
    size: FloatArray = field(default_factory=lambda: np.ones(1))
    unlit: bool = False
    double_sided: bool = True
    light: FloatArray | None = None
    transmission_tint: FloatArray = field(default_factory=lambda: np.ones(3))

    def __post_init__(self) -> None:
        position = checked("SurfelSet.position", self.position, (None, 3), np.float64)
        object.__setattr__(self, "position", position)
        for name in ("normal", "color"):
            value = checked(f"SurfelSet.{name}", getattr(self, name), position.shape, np.float64)
            object.__setattr__(self, name, value)
        all_alike = np.shape(self.size) == (1,)
        size = np.repeat(self.size, len(position)) if all_alike else self.size
        size = checked("SurfelSet.size", size, (len(position),), np.float64)
        if not ((size >= 0) & (size <= 1)).all():
            raise ValueError("SurfelSet.size: expected 0 to 1")
        object.__setattr__(self, "size", size)
        if self.light is not None:
            light = checked("SurfelSet.light", self.light, position.shape, np.float64)
            if not ((light >= 0) & (light <= 1)).all():
                raise ValueError("SurfelSet.light: expected 0 to 1")
            if self.unlit:
                raise ValueError("SurfelSet.light: expected none beside light in the colours")
            object.__setattr__(self, "light", light)
        tint = checked("SurfelSet.transmission_tint", self.transmission_tint, (3,), np.float64)
        object.__setattr__(self, "transmission_tint", tint)
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

    @property
    def exposure(self) -> FloatArray:
        """(n, 2) how much of the sky's light reaches the side of the normal, and the other."""
        return np.ones((len(self), 2)) if self.light is None else self.light[:, :2]

    @property
    def transmission(self) -> FloatArray:
        """(n,) share of light that passes through."""
        return np.zeros(len(self)) if self.light is None else self.light[:, 2]

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
            size=self.size[rows],
            light=None if self.light is None else self.light[rows],
            spacing=spacing,
        )

    def moved(self, shift: FloatArray) -> SurfelSet:
        """The set elsewhere, by (3,) metres."""
        return replace(self, position=self.position + shift)

    def discs(self, radius_m: npt.ArrayLike) -> tuple[IntArray, FloatArray]:
        """(m,) int32 how many surfels to draw where discs of radii (m,), metres, are small enough,
        and (m,) metres, the radii of those of size 1: larger where there are no more surfels."""
        radius = np.asarray(radius_m, np.float64)
        least = self.spacing.radius(max(len(self), 1))
        return self.spacing.prefixes(radius), np.maximum(radius, least)
