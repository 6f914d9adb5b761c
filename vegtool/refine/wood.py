"""Wood reduced to a small mesh that covers as many pixels as the wood does, whatever the view.

By Cauchy's formula the mean shadow of a convex body is a quarter of its surface, that of a sheet
seen from both sides half of its area. So every stem is drawn as a straight taper whose surface is
that of its faces: as a prism of a few sides where it is thick on the screen, as two sides of a
triangular prism (which has the same outline as all three) or as a ribbon where it is thin, and
stems much smaller than a pixel by one among them that is made as much wider (Cook, Halstead, Planck,
Ryu: Stochastic simplification of aggregate detail, 2007).

Which stem gets how many triangles follows from one price of a triangle in pixels drawn wrongly: the
one at which the budget is spent (Everett 1963, "Generalized Lagrange multiplier method").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, IntArray, checked, unit
from vegtool.refine.wood_lines import Ints, ends
from vegtool.refine.wood_lumps import Lump
from vegtool.refine.wood_stems import Stems

ROUNDS = 40
"""Of the bisection for the price."""
DEAREST, CHEAPEST = 1e9, 1e-9
"""Pixels per triangle."""
BENT = 0.4
"""How much of what a straight taper covers is wrong, over its greatest deviation in diameters: it is
the mean that counts, of which a picture shows a part."""
TIP = 0.5
"""Of the girth before: a stem whose end is thinner, or thinner than a pixel, ends in a point."""


@dataclass(frozen=True)
class Section:
    """What a stem is across. points: of its outline. sides: how many of them are drawn.

    wrong: share of what it covers that is drawn wrongly where it is much thinner than a pixel, and
    where it is a pixel thick or more.
    """

    points: int
    sides: int
    wrong: tuple[float, float]


SECTIONS = (
    Section(2, 1, (0.3, 0.8)),
    Section(3, 2, (0.06, 0.12)),
    Section(3, 3, (0.06, 0.07)),
    Section(5, 5, (0.02, 0.02)),
    Section(7, 7, (0.005, 0.005)),
)
"""Measured shares would be 0.42, 0.04, 0.04, 0.013 and 0.007; these, which count what is lit wrongly
as well, gave the least FLIP of the wood of four plants. Odd numbers of sides, because the outline of
a regular prism is then nearly as wide from everywhere."""


@dataclass(frozen=True, eq=False)
class Wood:
    """A mesh of wood, v vertices and t triangles, to be drawn from both sides.

    positions: (v, 3) metres. normals: (v, 3) unit. colors: (v, 3) linear. faces: (t, 3) int32,
    counter-clockwise from outside. stems: how many branches it shows. drawn: by how many.
    """

    positions: FloatArray
    normals: FloatArray
    colors: FloatArray
    faces: IntArray
    stems: int
    drawn: int

    def __post_init__(self) -> None:
        positions = checked("Wood.positions", self.positions, (None, 3), np.float64)
        n = len(positions)
        values = {
            "positions": positions,
            "normals": checked("Wood.normals", self.normals, (n, 3), np.float64),
            "colors": checked("Wood.colors", self.colors, (n, 3), np.float64),
            "faces": checked("Wood.faces", self.faces, (None, 3), np.int32, n),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)


@dataclass(frozen=True, eq=False)
class Choice:
    """What is drawn of the stems at one price. wider: (t,) how many times their surface stems
    show, 0 for those that others stand for. section: (t,) index into SECTIONS. halves: (s,) bool,
    spans that are halved. lumps: what is drawn as such, in place of its stems. cost: triangles."""

    wider: FloatArray
    section: Ints
    halves: np.ndarray
    lumps: tuple[Lump, ...]
    cost: int


def reduced_wood(stems: Stems, triangles: int, pixel_m: float) -> Wood | None:
    """The stems as a mesh of at most that many triangles; None for none.

    pixel_m: metres that a pixel covers, where the mesh is seen from nearest.
    """
    if triangles < 1:
        return None
    screen = Screen.of(stems, pixel_m)
    low, high = np.log(CHEAPEST), np.log(DEAREST)
    best = screen.choice(DEAREST)
    for _ in range(ROUNDS):
        middle = (low + high) / 2
        choice = screen.choice(np.exp(middle))
        if choice.cost <= triangles:
            best, high = choice, middle
        else:
            low = middle
        if high - low < 1e-3:
            break
    return built(stems, best, screen.pointed)


@dataclass(frozen=True, eq=False)
class Screen:
    """The stems in pixels. covered: (t,) mean over all views. thick: (t,) mean diameter. pointed:
    (t,) bool, ends in a point. order: (t,) stems one beside the other. span_*: of spans, how many
    pixels are wrong where they are straight; what halving saves; from which price on it does."""

    stems: Stems
    pixel: float
    solid: np.ndarray
    long: FloatArray
    covered: FloatArray
    thick: FloatArray
    pointed: np.ndarray
    order: Ints
    wrong: FloatArray
    saved: FloatArray
    worth: FloatArray

    @staticmethod
    def of(stems: Stems, pixel_m: float) -> Screen:
        pixel = pixel_m / stems.radius
        spans = stems.spans
        total = np.cumsum(stems.area)
        inner = stems.stem[1:] == stems.stem[:-1]
        step = np.append(0.0, np.linalg.norm(np.diff(stems.node, axis=0), axis=1) * inner)
        along = np.cumsum(step)
        surface = total[spans.b] - total[spans.a]
        length = np.maximum(along[spans.b] - along[spans.a], np.finfo(float).tiny)
        thick = surface / (np.pi * length) / pixel
        beside = spans.deviation / pixel / np.maximum(thick, 1.0)
        wrong = surface / 4 / pixel**2 * np.minimum(BENT * beside, 2.0)
        whole = spans.parent < 0
        halves = np.bincount(spans.parent[~whole], wrong[~whole], len(wrong))
        can = spans.middle >= 0
        saved = np.where(can, wrong - halves, 0.0)
        worth = np.where(can, wrong, 0.0)
        for span in np.flatnonzero(~whole):
            worth[span] = min(worth[span], worth[spans.parent[span]])
        covered, thick = surface[whole] / 4 / pixel**2, thick[whole]
        end = stems.girth[stems.last]
        before = stems.girth[stems.last - 1]
        pointed = (end < TIP * before) | (end / np.pi < pixel)
        long = length[whole] / pixel
        wrong[whole] += 2 * long * stems.rough / pixel
        solid = np.zeros(len(stems), dtype=bool)
        for one in stems.solids:
            solid[one.stems] = True
        return Screen(
            stems, pixel, solid, long, covered, thick, pointed, beside_each_other(stems),
            wrong, saved, worth,
        )  # fmt: skip

    def choice(self, price: float) -> Choice:
        """What is worth its triangles at that price, pixels per triangle."""
        stems, spans = self.stems, self.stems.spans
        wider = self._groups(price)
        whole = np.flatnonzero(spans.parent < 0)
        stem = stems.stem[spans.b]
        count = len(stems)
        thick = np.clip(self.thick * wider, 0.0, 1.0)
        best = np.full(count, np.inf)
        section, cost = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
        for index, option in enumerate(SECTIONS):
            each = 2 * option.sides
            halved = self.worth >= price * each
            parts = 1 + np.bincount(stem, halved, count).astype(np.int64)
            saved = np.bincount(stem, halved * self.saved, count)
            triangles = each * parts - option.sides * self.pointed
            across = option.wrong[0] * (1 - thick) + option.wrong[1] * thick
            wrong = (across * self.covered + self.wrong[whole] - saved) * wider
            value = wrong + price * triangles
            better = value < best
            best[better], section[better], cost[better] = (
                value[better], index, triangles[better],
            )  # fmt: skip
        chosen = []
        for solid in stems.solids:
            lump = min(solid.lumps, key=lambda one: self._of_lump(one, price))
            if self._of_lump(lump, price) < best[solid.stems].sum():
                wider[solid.stems] = 0.0
                chosen.append(lump)
        sides = np.array([option.sides for option in SECTIONS])[section]
        halves = (self.worth >= price * 2 * sides[stem]) & (wider > 0)[stem]
        total = int(cost[wider > 0].sum()) + sum(len(lump.faces) for lump in chosen)
        return Choice(wider, section, halves, tuple(chosen), total)

    def _of_lump(self, lump: Lump, price: float) -> float:
        """What it costs to draw one."""
        return lump.wrong / self.pixel**2 + price * len(lump.faces)

    def _groups(self, price: float) -> FloatArray:
        """(t,) how many times its own surface each stem shows: neighbours that are together worth
        no more than a triangle are shown by the largest of them."""
        small = self.order[(self.covered < price)[self.order] & ~self.solid[self.order]]
        wider = np.ones(len(self.covered))
        if len(small):
            covered = self.covered[small]
            group = np.floor((np.cumsum(covered) - covered / 2) / price).astype(np.int64)
            group = np.unique(group, return_inverse=True)[1]
            largest = small[np.lexsort((covered, group))[np.cumsum(np.bincount(group)) - 1]]
            wider[small] = 0.0
            wider[largest] = np.bincount(group, covered) / self.covered[largest]
        return wider


def beside_each_other(stems: Stems) -> Ints:
    """(t,) stems along a curve through space (Morton 1966) that passes neighbours one by one."""
    middle = (stems.node[stems.first] + stems.node[stems.last]) / 2
    cell = np.clip((middle + 1) * 512, 0, 1023).astype(np.int64)
    key = np.zeros(len(cell), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            key |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(key, kind="stable")


def built(stems: Stems, choice: Choice, pointed: np.ndarray) -> Wood:
    """The mesh of a choice."""
    _, at, girth, color, stem = straightened(stems, choice, pointed)
    parts = []
    for index, option in enumerate(SECTIONS):
        own = np.flatnonzero((choice.section == index)[stem])
        if len(own):
            parts.append(swept(at[own], girth[own], color[own], stem[own], option))
    for lump in choice.lumps:
        parts.append((lump.positions, lump.normals, lump.colors, lump.faces))
    base = np.cumsum([0, *(len(part[0]) for part in parts)])
    return Wood(
        np.concatenate([part[0] for part in parts]) * stems.radius + stems.center,
        np.concatenate([part[1] for part in parts]),
        np.concatenate([part[2] for part in parts]),
        np.concatenate([part[3] + b for part, b in zip(parts, base[:-1], strict=True)]),
        len(stems),
        int((choice.wider > 0).sum()),
    )


def straightened(
    stems: Stems, choice: Choice, pointed: np.ndarray
) -> tuple[Ints, FloatArray, FloatArray, FloatArray, Ints]:
    """The nodes that are left, (m,), where they are, (m, 3), their girths and colours and stems."""
    kept = np.zeros(len(stems.node), dtype=bool)
    shown = choice.wider > 0
    kept[stems.first[shown]] = kept[stems.last[shown]] = True
    kept[stems.spans.middle[choice.halves]] = True
    node = np.flatnonzero(kept)
    stem = stems.stem[node]
    at = joined(stems, node, shown)
    area, around = stretches(stems.area, node, stem)
    light = np.concatenate([stems.color[:, :, None], stems.swing], axis=2)
    _, color = stretches(light, node, stem)
    color /= np.maximum(around, np.finfo(float).tiny)[:, None, None]
    inner = np.append(False, stem[1:] == stem[:-1])
    after = np.append(inner[1:], False)
    girth = np.where(pointed[stem] & (node == stems.last[stem]), 0.0, stems.girth[node])
    length = np.where(inner, np.linalg.norm(at - np.roll(at, 1, axis=0), axis=1), 0.0)
    for _ in range(3):
        taper = np.where(inner, (girth + np.roll(girth, 1)) / 2 * length, 0.0)
        there = taper + np.where(after, np.roll(taper, -1), 0.0)
        girth = girth * np.divide(around, there, out=np.ones_like(girth), where=there > 0)
    girth = girth * scaled(girth, length, inner, area, stem)
    return node, at, girth * choice.wider[stem], color, stem


def stretches(values: FloatArray, node: Ints, stem: Ints) -> tuple[FloatArray, FloatArray]:
    """Of values (n, ...) of the original nodes, the sums (m, ...) since the node of the stem that
    is left before this one, and those from there to the next."""
    total = np.cumsum(values, axis=0)[node]
    inner = stem[1:] == stem[:-1]
    step = np.diff(total, axis=0) * inner.reshape(-1, *[1] * (values.ndim - 1))
    none = np.zeros_like(values[:1])
    before, after = np.concatenate([none, step]), np.concatenate([step, none])
    return before, before + after


def scaled(
    girth: FloatArray, length: FloatArray, inner: np.ndarray, area: FloatArray, stem: Ints
) -> FloatArray:
    """(m,) by what to multiply girths so that each stem has its surface."""
    taper = np.where(inner, (girth + np.roll(girth, 1)) / 2 * length, 0.0)
    made, wanted = np.bincount(stem, taper), np.bincount(stem, area)
    factor = np.divide(wanted, made, out=np.ones_like(made), where=made > 0)
    return np.asarray(factor[stem])


def joined(stems: Stems, node: Ints, shown: np.ndarray) -> FloatArray:
    """(m, 3) where the nodes that are left are, starts of stems on the straightened line of their
    hosts."""
    at = stems.node.copy()
    first = np.zeros(len(at), dtype=bool)
    depth = np.zeros(len(stems), dtype=np.int64)
    host = stems.host
    above = np.where(host >= 0, host, -1)
    while (above >= 0).any():
        depth += above >= 0
        above = np.where(above >= 0, host[above], -1)
    before = np.searchsorted(node, np.arange(len(at)), side="right") - 1  # the last kept up to here
    for level in range(1, int(depth.max(initial=0)) + 1):
        child = np.flatnonzero((depth == level) & shown & (host >= 0))
        child = child[shown[host[child]]]
        end = stems.host_node[child]
        lower = np.where(stems.host_part[child] < 1, end - 1, end)
        a = node[before[lower]]
        exact = a == end
        b = node[np.minimum(before[lower] + 1, len(node) - 1)]
        b = np.where(exact, a, b)
        point = (
            stems.node[lower]
            + (stems.node[end] - stems.node[lower])
            * np.where(lower == end, 1.0, stems.host_part[child])[:, None]
        )
        line = stems.node[b] - stems.node[a]
        square = np.maximum((line**2).sum(axis=1), np.finfo(float).tiny)
        part = np.clip(((point - stems.node[a]) * line).sum(axis=1) / square, 0, 1)
        at[stems.first[child]] = at[a] + part[:, None] * (at[b] - at[a])
    del first
    return at[node]


def swept(
    at: FloatArray, girth: FloatArray, color: FloatArray, stem: Ints, section: Section
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Positions, normals, colours and faces of stems with one section."""
    inner = stem[1:] == stem[:-1]
    step = unit(np.diff(at, axis=0)) * inner[:, None]
    tangent = unit(
        np.concatenate([np.zeros((1, 3)), step]) + np.concatenate([step, np.zeros((1, 3))])
    )
    u = transported(tangent, stem)
    v = np.cross(tangent, u)
    k = section.points
    angle = 2 * np.pi * np.arange(k) / k
    out = np.cos(angle)[None, :, None] * u[:, None] + np.sin(angle)[None, :, None] * v[:, None]
    reach = 0.25 if k == 2 else 1 / (2 * k * np.sin(np.pi / k))
    positions = at[:, None] + reach * girth[:, None, None] * out
    normals = np.repeat(v[:, None], k, axis=1) if k == 2 else out
    around = 0.0 if k == 2 else 2 * np.einsum("mcd,mkd->mkc", color[:, :, 1:], out)
    colors = np.maximum(color[:, None, :, 0] + around, 0.0) * np.ones((1, k, 1))
    j = np.arange(section.sides)
    a = np.flatnonzero(inner)[:, None] * k
    a0, a1 = a + j, a + (j + 1) % k
    b0, b1 = a0 + k, a1 + k
    lower = np.stack([a0, a1, b0], axis=-1).reshape(-1, 3)
    blunt = girth[1:][inner] > 0
    upper = np.stack([a1, b1, b0], axis=-1)[blunt].reshape(-1, 3)
    faces = np.concatenate([lower, upper]).astype(np.int32)
    return (
        positions.reshape(-1, 3),
        normals.reshape(-1, 3),
        colors.reshape(-1, 3),
        faces,
    )


def transported(tangent: FloatArray, stem: Ints) -> FloatArray:
    """(m, 3) unit vectors across the tangents, turned as little as the stems bend; stems that stand
    side by side start at angles of their own."""
    first, last = ends(np.unique(stem, return_inverse=True)[1])
    axis = np.eye(3)[np.abs(tangent[first]).argmin(axis=1)]
    u = unit(np.cross(tangent[first], axis))
    v = np.cross(tangent[first], u)
    angle = 2 * np.pi * ((stem[first] * (5**0.5 - 1) / 2) % 1)
    across = np.zeros_like(tangent)
    across[first] = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v
    for nth in range(1, int((last - first).max(initial=0)) + 1):
        here = (first + nth)[first + nth <= last]
        t = tangent[here]
        before = across[here - 1]
        across[here] = unit(before - (before * t).sum(axis=1)[:, None] * t)
    return across
