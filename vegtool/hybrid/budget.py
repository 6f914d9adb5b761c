"""The weights with which a hybrid keeps to a budget.

The least error with no more than so many triangles and fragments is a least cost whose weights are
Lagrange multipliers (Everett 1963, "Generalized Lagrange multiplier method"): the weight of
polygons is found by bisection for a weight of fill, and that of fill, where there is a limit to it,
by bisection around that.
"""

from __future__ import annotations

from vegtool.hybrid.greedy import Descent, descent
from vegtool.hybrid.options import Budget, Weights
from vegtool.progress import Progress, silent

LEAST, MOST = 1e-3, 1e3
"""Weights of polygons, of an error of 1, between which they are sought."""
FILL = Weights().fill
"""Weight of fill where there is no limit to it."""
LEAST_FILL, MOST_FILL = 1e-3, 1e2
"""Between which it is sought, where there is one."""
HALVINGS, FILL_HALVINGS = 10, 6
"""Of the ratios: to 1.4 % and to 20 %."""


def within(
    start: Descent, budget: Budget, cheap: bool = False, progress: Progress = silent
) -> Descent:
    """The hybrid of the least error that keeps to a budget, as far as one does: else of those that
    have the fewest triangles, that which fills least. start: tells the model and its cloud alone.
    cheap: as the poster."""
    if budget.fill is None:
        return _for_polygons(start, budget.triangles, FILL, cheap, progress)
    best = _for_polygons(start, budget.triangles, LEAST_FILL, cheap, progress)
    if best.terms.fill <= budget.fill:
        return best
    low, high = LEAST_FILL, MOST_FILL
    best = _for_polygons(start, budget.triangles, high, cheap, progress)
    for nth in range(FILL_HALVINGS):
        progress("budget", nth / FILL_HALVINGS)
        middle = (low * high) ** 0.5
        found = _for_polygons(start, budget.triangles, middle, cheap, progress)
        if found.terms.fill <= budget.fill:
            high, best = middle, found
        else:
            low = middle
    return best


def _for_polygons(
    start: Descent, triangles: int, fill: float, cheap: bool, progress: Progress
) -> Descent:
    def ended(polygons: float) -> Descent:
        now = start.again(Weights(1.0, polygons, fill))
        for _ in descent(now, cheap):
            pass
        return now

    best = ended(LEAST)
    if best.triangles <= triangles:
        return best
    low, high, best = LEAST, MOST, ended(MOST)
    for nth in range(HALVINGS):
        progress("weights", nth / HALVINGS)
        middle = (low * high) ** 0.5
        found = ended(middle)
        if found.triangles <= triangles:
            high, best = middle, found
        else:
            low = middle
    return best
