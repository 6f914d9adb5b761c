"""Checks shared by the frozen data classes: shape, dtype, finite values, index range.

A data class calls `checked` for each of its arrays in `__post_init__`; the array that it keeps
is read-only, so that no operation can change its input by accident.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]
ByteArray = npt.NDArray[np.uint8]
SingleArray = npt.NDArray[np.float32]
Picture = SingleArray
"""(height, width, 4): linear light premultiplied by coverage, and coverage."""


def checked(
    name: str,
    value: npt.ArrayLike,
    shape: tuple[int | None, ...],
    dtype: npt.DTypeLike,
    below: int | None = None,
) -> npt.NDArray[Any]:
    """Return `value` as a read-only C-contiguous array of that shape and dtype.

    `shape`: None stands for any length. `below`: for indices, every value must lie in [0, below).
    Raises ValueError naming the array, what was expected and what was found. A programming
    error, not a user's: readers check files themselves and raise InputError.
    """
    array = np.ascontiguousarray(value, dtype=dtype)
    if array.ndim != len(shape) or any(
        want is not None and want != have for want, have in zip(shape, array.shape, strict=True)
    ):
        wanted = "(" + ", ".join("n" if s is None else str(s) for s in shape) + ")"
        raise ValueError(f"{name}: expected shape {wanted}, got {array.shape}")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise ValueError(f"{name}: holds NaN or infinite values")
    if below is not None and array.size and (array.min() < 0 or array.max() >= below):
        raise ValueError(
            f"{name}: indices must lie in 0..{below - 1}, found {array.min()}..{array.max()}"
        )
    if array.flags.writeable:
        if array is value or np.shares_memory(array, np.asarray(value)):
            array = array.view()  # freeze our view, not the caller's array
        array.flags.writeable = False
    return array


def unit(vectors: FloatArray) -> FloatArray:
    """Vectors (n, 3) scaled to length one; zero vectors stay zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0))
