"""Models made by functions, like those of papers in kind and in number of triangles alone.

Of "Hybrid billboard clouds" (sketch and poster): a cartoon figure and an airplane, of closed
pieces, smooth between creases, without alpha. Of "Surfel billboard hierarchies", table 1: all of
`TABLE_1`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from solids.airplane import FINE, airplane
from solids.armadillo import armadillo
from solids.figure import figure
from solids.rabbit import rabbit
from solids.terrain import height_field
from solids.tree import tree
from vegtool.plant import Plant

__all__ = ["TABLE_1", "airplane", "armadillo", "figure", "height_field", "rabbit", "tree"]

TABLE_1: dict[str, tuple[int, Callable[[], Plant]]] = {
    "airplane": (22_814, partial(airplane, FINE)),
    "rabbit": (104_026, rabbit),
    "armadillo": (215_914, armadillo),
    "tree": (50_200, tree),
    "height field": (524_288, height_field),
}
"""Number of triangles, which is exact, and what makes the model."""
