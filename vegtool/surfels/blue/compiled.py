"""Loops that numpy has no words for, as machine code.

Modules that use this import numba, which takes half a second: they are imported where they are
called, and never when vegtool starts.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """The function, compiled when it is first called, and kept on disk where that can be written.

    Arithmetic is IEEE's in the order that is written, so that every machine finds the same.
    """
    try:
        return cast(Function, njit(cache=True)(function))
    except RuntimeError:  # numba found no folder to keep it in
        return cast(Function, njit(function))
