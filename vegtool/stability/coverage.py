"""Coverage: alpha fitted to a client's filter, and solved against a truth, on whatever there is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from vegtool.arrays import ByteArray, IntArray
from vegtool.baking.bake import bake
from vegtool.baking.options import BakeOptions
from vegtool.boxes import make_billboards
from vegtool.clustering import cluster
from vegtool.lod import Display, Level
from vegtool.measure.metrics import reference
from vegtool.measure.scores import Truths, truths
from vegtool.measure.views import views
from vegtool.refine.coverage import (
    FACTORS,
    ROUNDS,
    SURPLUS,
    expected,
    measured_bias,
    pictures,
    ranked,
    seen_at,
    solve_coverage,
    thresholds,
    unbiased_alpha,
    with_alpha,
)
from vegtool.seeding import generator
from vegtool.stability.case import Case, Outcome, exact, holds
from vegtool.stability.plants import tree

GUTTER = 2


def framed(picture: ByteArray) -> tuple[ByteArray, IntArray]:
    """An atlas with one picture, and its rectangle."""
    height, width = picture.shape
    atlas = np.zeros((height + 12, width + 12), np.uint8)
    atlas[6 : 6 + height, 6 : 6 + width] = picture
    return atlas, np.array([[6, 6, width, height]], np.int32)


def twigs(value: int) -> ByteArray:
    """(40, 40) lines one texel wide."""
    picture = np.zeros((40, 40), np.uint8)
    picture[:, ::7] = value
    return picture


def leaf() -> ByteArray:
    """(40, 40) a disc with a soft edge and a hole."""
    y, x = np.indices((40, 40)) - 19.5
    radius = np.hypot(x, y)
    return np.asarray(255 * np.clip(15.5 - radius, 0, 1) * np.clip(radius - 4, 0, 1), np.uint8)


PICTURES: dict[str, ByteArray] = {
    "an empty picture": np.zeros((9, 7), np.uint8),
    "an opaque picture": np.full((9, 7), 255, np.uint8),
    "one empty texel": np.zeros((1, 1), np.uint8),
    "one opaque texel": np.full((1, 1), 255, np.uint8),
}
"""Nothing may grow or vanish."""
UNEASY: dict[str, ByteArray] = {
    "one texel, half covered": np.full((1, 1), 128, np.uint8),
    "a line of texels": np.full((1, 30), 77, np.uint8),
    "all alike": np.full((20, 20), 90, np.uint8),
    "twigs that cover 1/255": twigs(1),
    "twigs that cover a third": twigs(85),
    "opaque lines": twigs(255),
    "one opaque texel of many": np.pad(np.full((1, 1), 255, np.uint8), 12),
    "one clear texel of many": np.pad(np.zeros((1, 1), np.uint8), 12, constant_values=255),
    "a leaf": leaf(),
    "noise": generator(0, "stability", "alpha").integers(0, 256, (40, 40)).astype(np.uint8),
}


def unchanged(picture: ByteArray) -> Outcome:
    """Empty and opaque pictures stay as they are, whatever is asked for."""
    atlas, rects = framed(picture)
    wrong = [
        not np.array_equal(unbiased_alpha(atlas, rects, GUTTER, factor=factor), atlas)
        for factor in (0.0, 0.5, 1.0, 2.0)
    ]
    return holds(sum(wrong), "the same picture, for every factor")


def nearest(picture: ByteArray) -> Outcome:
    """Of all thresholds there are, none is expected to miss the target by less."""
    atlas, rects = framed(picture)
    ranks = ranked(atlas, rects, GUTTER)
    passing = expected(ranks, seen_at(1.0, 2.0))
    found = thresholds(passing, ranks.target(1.0))[0]
    covered = float(ranks.covered[0])
    choices = passing.texels[0]
    miss = abs(choices[round(found - passing.low)] - covered)
    least = min(abs(float(choice) - covered) for choice in choices)
    note = f"covers {covered:.2f} texels, expected {covered:.2f} within {miss:.2f}"
    return exact(abs(miss - least) / max(covered, 1.0), note=note)


def one_way(picture: ByteArray) -> Outcome:
    """The more is asked for, the more texels pass: shapes grow and shrink about themselves."""
    atlas, rects = framed(picture)
    factors = np.geomspace(0.1, 10.0, 15)
    passes = [unbiased_alpha(atlas, rects, GUTTER, factor=factor) >= 128 for factor in factors]
    wrong = [bool((a & ~b).any()) for a, b in pairwise(passes)]
    again = unbiased_alpha(atlas, rects, GUTTER, factor=factors[0]) >= 128
    return holds(sum(wrong) + int((again != passes[0]).sum()), "each within the next; twice alike")


def scene() -> tuple[Level, Truths]:
    """A tree of twelve billboards, with alpha as baked, and the truth from three views."""
    labels = cluster(tree(), "kmeans", 12)
    boards = make_billboards(tree(), labels)
    level = bake(tree(), labels, boards, 60 / tree().height, BakeOptions(fit_alpha=False))
    return level, truths(tree(), views("all", 3), [60.0], Display())


def bare(truth: Truths) -> Truths:
    """The same views of nothing."""
    empty = [tuple(reference(np.zeros_like(r.picture)) for r in row) for row in truth.references]
    return replace(truth, references=tuple(empty))


def filled(level: Level, alpha: int) -> Level:
    """The level with one alpha all over."""
    assert level.atlas is not None
    return with_alpha(level, np.full(level.atlas.color.shape[:2], alpha, np.uint8))


def same(level: Level, truth: Truths) -> tuple[Level, Truths]:
    """As it is."""
    return level, truth


def clear(level: Level, truth: Truths) -> tuple[Level, Truths]:
    return filled(level, 0), truth


def opaque(level: Level, truth: Truths) -> tuple[Level, Truths]:
    return filled(level, 255), truth


def faint(level: Level, truth: Truths) -> tuple[Level, Truths]:
    return filled(level, 1), truth


def no_truth(level: Level, truth: Truths) -> tuple[Level, Truths]:
    return level, bare(truth)


def solved(change: Callable[[Level, Truths], tuple[Level, Truths]]) -> Outcome:
    """The solve ends, is no worse than where it began, and says finite things."""
    level, truth = change(*scene())
    found = solve_coverage(level, [truth], GUTTER)
    first = unsolved(level, truth)
    wrong = [
        found.rounds > ROUNDS,
        abs(found.bias - SURPLUS) > abs(first - SURPLUS) + 1e-12,
        not FACTORS[0] <= found.factor <= FACTORS[1],
        not np.isfinite(found.bias),
    ]
    note = f"factor {found.factor:.2f}, bias {first:+.3f} to {found.bias:+.3f}"
    return holds(sum(wrong), "no worse than unsolved", found.rounds, note)


def unsolved(level: Level, truth: Truths) -> float:
    """Bias of the level before anything is scaled."""
    assert level.atlas is not None
    alpha = unbiased_alpha(level.atlas.color[..., 3], pictures(level.atlas), GUTTER)
    return measured_bias(with_alpha(level, alpha), [truth]) or 0.0


CASES = (
    *(
        Case(f"alpha of {name}", "coverage", "exact", partial(unchanged, picture))
        for name, picture in PICTURES.items()
    ),
    *(
        Case(f"threshold of {name}", "coverage", "exact", partial(nearest, picture))
        for name, picture in UNEASY.items()
    ),
    *(
        Case(f"growth of {name}", "coverage", "property", partial(one_way, picture))
        for name, picture in UNEASY.items()
    ),
    *(
        Case(f"solve of {name}", "coverage", "property", partial(solved, change), gl=True)
        for name, change in {
            "a tree": same, "a level all clear": clear, "a level all opaque": opaque,
            "a level all faint": faint, "a tree without a truth": no_truth,
        }.items()
    ),
)  # fmt: skip
