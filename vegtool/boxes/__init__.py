"""Labels become oriented boxes, and boxes single or crossed billboards."""

from vegtool.boxes.billboards import make_billboards, planes_per_box
from vegtool.boxes.box import Boxes
from vegtool.boxes.fit import fit_boxes
from vegtool.boxes.options import BoxOptions
from vegtool.boxes.planes import oriented_planes

__all__ = [
    "BoxOptions",
    "Boxes",
    "fit_boxes",
    "make_billboards",
    "oriented_planes",
    "planes_per_box",
]
