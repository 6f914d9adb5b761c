"""A plant as surfel billboards over a multi-triangulation: all that is drawn of it, from anywhere.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from vegtool.lod import Display
from vegtool.plant import Plant
from vegtool.surfels.bake import SurfelAtlas
from vegtool.surfels.hierarchy import SurfelHierarchy
from vegtool.surfels.multi_triangulation import MultiTriangulation
from vegtool.surfels.options import SurfelOptions


@dataclass(frozen=True, eq=False)
class SurfelModel:
    """triangles: of which the patches of the source's arcs are what the hierarchy stands on, in
    order. hierarchy: b billboards. textures: of these. display, options: what it was made for.
    notes: sentences for the user. seconds: how long each stage of making it took."""

    triangles: MultiTriangulation
    hierarchy: SurfelHierarchy
    textures: SurfelAtlas
    display: Display
    options: SurfelOptions
    notes: tuple[str, ...] = ()
    seconds: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.plant.extent > 0:
            raise ValueError("SurfelModel: expected a plant with an extent")
        source = len(self.triangles.error) - 1
        patches = int((self.triangles.start == source).sum())
        if len(self.hierarchy.above) != patches:
            raise ValueError(
                f"SurfelModel: expected a hierarchy over {patches} patches, got "
                f"{len(self.hierarchy.above)}"
            )
        if len(self.textures.atlas.front) != len(self.hierarchy):
            raise ValueError("SurfelModel: the atlas needs a rectangle for each billboard")

    @property
    def plant(self) -> Plant:
        """The original: its vertices are those of all triangles."""
        return self.triangles.plant

    def without_exposure(self) -> SurfelModel:
        """The same under all of the sky's light: textures of billboards do not tell how much of it
        reaches a place, and triangles that do would be darker than the billboards above them."""
        plant = replace(self.plant, exposure=None)
        return replace(self, triangles=replace(self.triangles, plant=plant))

    @property
    def texels(self) -> np.ndarray:
        """(b, 2) int32 texels along o1 and o2 of each billboard's front."""
        return np.asarray(self.textures.atlas.front[:, 2:])
