"""Samples that are not plants."""

from __future__ import annotations
from collections.abc import Callable
from vegtool.plant import Plant

SOLIDS: dict[str, Callable[[int | None, int], Plant]] = {}
