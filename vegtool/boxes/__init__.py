"""Labels become oriented boxes, and boxes single or crossed billboards."""

from typing import TYPE_CHECKING

from vegtool.boxes.options import BoxOptions
from vegtool.later import later

if TYPE_CHECKING:
    from vegtool.boxes.billboards import make_billboards
    from vegtool.boxes.box import Boxes
    from vegtool.boxes.budget import fit_budget
    from vegtool.boxes.error import geometric_error
    from vegtool.boxes.fit import fit_boxes
    from vegtool.boxes.planes import oriented_planes
else:
    __getattr__ = later(
        __name__,
        {
            "billboards": ("make_billboards",),
            "box": ("Boxes",),
            "budget": ("fit_budget",),
            "error": ("geometric_error",),
            "fit": ("fit_boxes",),
            "planes": ("oriented_planes",),
        },
    )

__all__ = [
    "BoxOptions",
    "Boxes",
    "fit_boxes",
    "fit_budget",
    "geometric_error",
    "make_billboards",
    "oriented_planes",
]
