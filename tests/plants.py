"""Plants of bare triangles, which the tests of several rooms share."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.plant import Branches, Material, Plant


def plant_of(
    corners: npt.ArrayLike, branches: Branches | None = None, double_sided: bool = True
) -> Plant:
    """A plant from (f, 3, 3) corners, as a triangle soup of leaves."""
    positions = np.asarray(corners, dtype=np.float64).reshape(-1, 3)
    n = len(positions)
    return Plant(
        name="test",
        positions=positions,
        normals=np.tile([0.0, 1.0, 0.0], (n, 1)),
        uvs=np.zeros((n, 2)),
        faces=np.arange(n, dtype=np.int32).reshape(-1, 3),
        face_material=np.zeros(n // 3, dtype=np.int32),
        materials=(Material("leaf", role="leaf", double_sided=double_sided),),
        branches=branches,
    )
