"""Every case of numerical stability holds, and the table says so."""

from __future__ import annotations

from itertools import pairwise

import pytest

from vegtool.stability import CaseResult, cases, markdown, run
from vegtool.stability.case import Case, Outcome, exact, run_case, same_objective

CASES = [
    pytest.param(case.name, marks=[pytest.mark.gl] if case.gl else [], id=case.name)
    for case in cases()
]


@pytest.mark.parametrize("name", CASES)
def test_case_holds(name: str) -> None:
    (result,) = run(names=[name])
    assert result.passed, (
        f"{result.name}: {result.error:.2e}, at most {result.tolerance:.2e} allowed"
        f" ({result.reason}); {result.note}"
    )


def test_names_are_unique_and_topics_together() -> None:
    names = [case.name for case in cases()]
    assert len(set(names)) == len(names)
    topics = [case.topic for case in cases()]
    assert len({*topics}) == 1 + sum(a != b for a, b in pairwise(topics))


def test_a_case_that_raises_fails_and_says_why() -> None:
    def broken() -> Outcome:
        raise ValueError("no such plant")

    result = run_case(Case("broken", "none", "exact", broken))
    assert not result.passed
    assert result.note == "ValueError: no such plant"


def test_overflow_is_an_error() -> None:
    import numpy as np

    def huge() -> Outcome:
        return exact(float(np.square(np.array([1e200])).sum()))

    assert "overflow" in run_case(Case("huge", "none", "exact", huge)).note


def test_tolerances_grow_with_the_offset_alone() -> None:
    """Half a billion sizes away, coordinates are known to 1e-7, so objectives no better."""
    assert same_objective(0.0).tolerance == 1e-6
    assert same_objective(0.0, 1e6).tolerance == 1e-6
    assert same_objective(0.0, 5e8).tolerance == pytest.approx(64 * 2.0**-52 * 5e8)
    assert exact(0.0).tolerance == 1e-9


def test_table_has_a_row_for_each_case() -> None:
    row = CaseResult("a | b", "boxes", "exact", 2e-10, 1e-9, "because", 3, 0.1, True, "")
    failed = CaseResult("c", "boxes", "property", 1.0, 0.0, "holds", None, 0.0, False, "twice")
    page = markdown([row, failed])
    assert "1 of 2 hold" in page
    assert "| a / b | exact | 2.0e-10 | 1.0e-09 | because | 3 | 0.10 |  |" in page
    assert "**c: fails**" in page
