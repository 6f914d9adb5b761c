"""The weights with which a hybrid keeps to a budget.

The least error with no more than so many triangles and fragments is a least cost whose weights are
Lagrange multipliers (Everett 1963, "Generalized Lagrange multiplier method"): the weight of
polygons is found by bisection for a weight of fill, and that of fill, where there is a limit to it,
by bisection around that. A weight may leave a gap (a little less of it, and all leaves are
triangles; a little more, and none are left), so what counts is not only where descents end: of all
the steps that they take, the best is kept.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from vegtool.hybrid.greedy import Descent, Proposal, descent
from vegtool.hybrid.options import Budget, Weights
from vegtool.progress import Progress, silent

LEAST, MOST = 1e-3, 1e3
"""Weights of polygons, of an error of 1, between which they are sought."""
LEAST_FILL, MOST_FILL = 1e-3, 1e2
"""Weights of fill, of an error of 1: of no limit to it; and between which it is sought."""
SPENDINGS = 13
"""Weights of polygons with which what is left of a budget is spent."""
SPENT = 0.97
"""Of the triangles: with no less, the budget is spent."""
STEP = 1e-9
"""Of the cost: a step that saves less is none."""
HALVINGS, FILL_HALVINGS = 10, 6
"""Of the ratios: to 1.4 % and to 20 %."""


def within(
    start: Descent, budget: Budget, cheap: bool = False, progress: Progress = silent
) -> Descent:
    """The hybrid of the least error that keeps to a budget, as far as one does: else of those that
    have the fewest triangles, that which fills least. start: tells the model and its cloud alone.
    cheap: as the poster."""
    tried = Tried(start, budget, cheap)
    fill = LEAST_FILL
    if not tried.at_fill(fill, progress):
        low, fill = LEAST_FILL, MOST_FILL
        if tried.at_fill(fill, progress):
            for _ in range(FILL_HALVINGS):
                middle = (low * fill) ** 0.5
                if tried.at_fill(middle, progress):
                    fill = middle
                else:
                    low = middle
    return tried.spent(fill)


def least_fill(start: Descent) -> float:
    """Of the billboards of what may not leave them: the fill that no hybrid goes below."""
    stays = (pairs[~start.solid[start.cloud.face[pairs]]] for pairs in start.pairs)
    return sum(start.billboard(pairs).fill for pairs in stays)


class Tried:
    """Descents that were made, and the best hybrid on their way."""

    def __init__(self, start: Descent, budget: Budget, cheap: bool) -> None:
        self.start, self.budget, self.cheap = start, budget, cheap
        self.best = start.again(start.weights)

    def at_fill(self, fill: float, progress: Progress = silent) -> bool:
        """Seek the least weight of polygons that keeps to the triangles, at a weight of fill;
        whether that keeps to the fill too."""
        now = self.ended(Weights(1.0, LEAST, fill))
        low, high = LEAST, MOST
        if now.triangles > self.budget.triangles:
            now = self.ended(Weights(1.0, MOST, fill))
            for nth in range(HALVINGS):
                progress("weights", nth / HALVINGS)
                middle = (low * high) ** 0.5
                found = self.ended(Weights(1.0, middle, fill))
                if found.triangles <= self.budget.triangles:
                    high, now = middle, found
                else:
                    low = middle
        return self.budget.fill is None or now.terms.fill <= self.budget.fill

    def ended(self, weights: Weights) -> Descent:
        """What a descent comes to."""
        now = self.start.again(weights)
        for _ in descent(now, self.cheap):
            if self.merit(now) < self.merit(self.best):
                self.best = now.copy()
        return now

    def spent(self, fill: float) -> Descent:
        """The best, and what else the triangles that it leaves may buy: with less and less weight
        of polygons each billboard, body and part of the mesh is looked at once, and what saves
        something without exceeding the budget is done."""
        now = self.best
        for polygons in np.geomspace(MOST, LEAST, SPENDINGS):
            if now.triangles >= SPENT * self.budget.triangles:
                break
            now.weights = Weights(1.0, float(polygons), fill)
            for number in list(now.parts):
                self._step(now, now.refinements(number))
            for source in range(now.sources):
                self._step(now, now.proposals(source))
        return now

    def _step(self, now: Descent, offers: Iterable[Proposal]) -> None:
        """Take the best of what is proposed, if it saves something and the budget allows it."""
        count, fill = len(now.part_of), self.budget.fill
        terms, best = now.terms, None
        for offer in offers:
            after = terms + offer.change
            fits = round(after.polygons * count) <= self.budget.triangles
            if not fits or (fill is not None and after.fill > max(fill, terms.fill)):
                continue
            if best is None or offer.change.cost(now.weights) < best.change.cost(now.weights):
                best = offer
        if best is None or best.change.error >= 0:
            return
        if best.change.cost(now.weights) < -STEP * terms.cost(now.weights):
            now.accept(best)

    def merit(self, one: Descent) -> tuple[float, float, float]:
        """Less is better: triangles over the budget, fill over it, error."""
        fill = self.budget.fill
        over = 0.0 if fill is None else max(0.0, one.terms.fill - fill)
        return max(0, one.triangles - self.budget.triangles), over, one.terms.error
