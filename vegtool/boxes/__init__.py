"""Labels become oriented boxes, and boxes single or crossed billboards."""

from vegtool.boxes.billboards import make_billboards
from vegtool.boxes.box import Boxes
from vegtool.boxes.budget import fit_budget
from vegtool.boxes.error import geometric_error
from vegtool.boxes.fit import fit_boxes
from vegtool.boxes.options import BoxOptions
from vegtool.boxes.planes import oriented_planes

__all__ = [
    "BoxOptions",
    "Boxes",
    "fit_boxes",
    "fit_budget",
    "geometric_error",
    "make_billboards",
    "oriented_planes",
]
