"""What tiles ask of the viewers of a scene, whoever knows where these may be."""

from __future__ import annotations

from typing import Any, Protocol

from vegtool.arrays import FloatArray
from vegtool.tiles.placement import BoolArray


class View(Protocol):
    """Where eyes may be, and what pictures they see: all on the safe side. boxes: (n, 2, 3) metres
    in the scene's frame, least and greatest corners."""

    @property
    def told(self) -> dict[str, Any]:
        """Plain values for readers of a tileset: what it is made for."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the user."""

    def refined(self, boxes: FloatArray, error_m: FloatArray, seen_px: FloatArray) -> BoolArray:
        """(n,) whether an eye may see errors (n,), metres, as more than (n,) pixels."""

    def passed(self, boxes: FloatArray, error_m: FloatArray) -> BoolArray:
        """(n,) whether every eye sees errors (n,), metres, as more pixels than clients let be."""

    @property
    def hills(self) -> bool:
        """Whether there is anything that hides."""

    def hidden(self, boxes: FloatArray) -> BoolArray:
        """(n,) whether the ground is before all of a box, for every eye."""

    def pixels_per_metre(self, boxes: FloatArray) -> FloatArray:
        """(n,) pixels that no metre in a box is more than; infinite where an eye may be in it."""
