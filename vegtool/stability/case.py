"""What a case of numerical stability is, how one is run, and what comes out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from time import perf_counter
from typing import Literal

import numpy as np

from vegtool.errors import CapabilityError

Oracle = Literal["exact", "equivariance", "property"]

EXACT = 1e-9
"""Relative error allowed where the right answer is known."""
OBJECTIVE = 1e-6
"""Relative difference of an objective allowed when the same plant is moved, scaled or turned."""
ROUNDINGS = 64.0
"""How many roundings of a coordinate far from the origin an objective may show."""


@dataclass(frozen=True)
class Outcome:
    """What a case found.

    error: relative, or the number of violations where a property is asked for. tolerance: what
    the error may be at most, and `reason` why. iterations: rounds until the end, where there are
    some. note: what else is worth saying.
    """

    error: float
    tolerance: float
    reason: str
    iterations: int | None = None
    note: str = ""


@dataclass(frozen=True)
class Case:
    """A case: its name, what it is about, what its answer is held against, and the function.

    gl: whether it draws.
    """

    name: str
    topic: str
    oracle: Oracle
    measure: Callable[[], Outcome]
    gl: bool = False


@dataclass(frozen=True)
class CaseResult:
    """A row of the table: the case and its outcome. seconds: of the whole case, oracle included."""

    name: str
    topic: str
    oracle: Oracle
    error: float
    tolerance: float
    reason: str
    iterations: int | None
    seconds: float
    passed: bool
    note: str


def run_case(case: Case) -> CaseResult:
    """Run one case, with overflow, division by zero and invalid values as errors.

    A case that raises has failed: its error is infinite, and the note says what was raised.
    Raises CapabilityError where a case draws and nothing can.
    """
    start = perf_counter()
    try:
        with np.errstate(divide="raise", over="raise", invalid="raise"):
            outcome = case.measure()
    except CapabilityError:
        raise
    except Exception as error:  # one failure must not hide the rest of the table
        outcome = Outcome(
            inf, 0.0, "ends without an error", note=f"{type(error).__name__}: {error}"
        )
    return CaseResult(
        case.name,
        case.topic,
        case.oracle,
        float(outcome.error),
        outcome.tolerance,
        outcome.reason,
        outcome.iterations,
        perf_counter() - start,
        bool(outcome.error <= outcome.tolerance),
        outcome.note,
    )


def relative(value: float, truth: float) -> float:
    """|value - truth| / |truth|; where the truth is 0, |value|."""
    return abs(value - truth) / (abs(truth) or 1.0)


def exact(error: float, offset_over_size: float = 0.0, note: str = "") -> Outcome:
    """The outcome of a case whose right answer is known; `offset_over_size` as in `widened`."""
    return widened(error, EXACT, "the exact answer", offset_over_size, note)


def same_objective(error: float, offset_over_size: float = 0.0, note: str = "") -> Outcome:
    """The outcome of a case that compares objectives; `offset_over_size` as in `widened`."""
    return widened(error, OBJECTIVE, "the same objective", offset_over_size, note)


def drawn(error: float, plant_over_picture: float = 1.0, note: str = "") -> Outcome:
    """The outcome of a case that compares pictures, drawn from single-precision positions about
    the plant's middle. plant_over_picture: its radius, in sizes of what the picture shows."""
    tolerance = ROUNDINGS * float(np.finfo(np.float32).eps) * max(plant_over_picture, 1.0)
    reason = f"{ROUNDINGS:.0f} roundings in single precision"
    if plant_over_picture > 1:
        reason += f" at {plant_over_picture:.1e} sizes from the middle"
    return Outcome(error, tolerance, reason, note=note)


def widened(
    error: float, tolerance: float, reason: str, offset_over_size: float, note: str
) -> Outcome:
    """An outcome with the tolerance that rounding allows.

    offset_over_size: the largest coordinates in sizes of the least thing that is measured; such
    coordinates are known to epsilon times that, which widens the tolerance where it is more.
    """
    rounding = ROUNDINGS * float(np.finfo(np.float64).eps) * offset_over_size
    if rounding > tolerance:
        reason = f"{ROUNDINGS:.0f} roundings at {offset_over_size:.1e} sizes from the origin"
    return Outcome(error, max(tolerance, rounding), reason, note=note)


def holds(violations: int, what: str, iterations: int | None = None, note: str = "") -> Outcome:
    """The outcome of a case that counts violations of a property, of which none may be."""
    return Outcome(float(violations), 0.0, what, iterations, note)
