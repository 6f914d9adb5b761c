"""Two models that are no plants, as in the figures of "Hybrid billboard clouds" (sketch and
poster): a cartoon figure and an airplane, of closed pieces, smooth between creases, without alpha.

Both are made by the functions here, and are like those of the figures in kind and in number of
triangles alone.
"""

from __future__ import annotations

from solids.airplane import airplane
from solids.figure import figure

__all__ = ["airplane", "figure"]
