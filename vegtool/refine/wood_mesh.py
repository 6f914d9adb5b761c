"""The triangles of a choice of stems and lumps, in the units of the stems."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, unit
from vegtool.refine.wood_choice import SECTIONS, Bools, Choice, Section
from vegtool.refine.wood_lines import Ints, ends, taper_areas
from vegtool.refine.wood_stems import Stems

FITTING = 3
"""Rounds in which girths are brought to give every stretch its surface."""
LEAST = 0.05
"""Of a stem's mean girth, but at points: what closes at both ends still has its surface."""
TINY = float(np.finfo(float).tiny)
GOLDEN = (5**0.5 - 1) / 2


@dataclass(frozen=True, eq=False)
class Mesh:
    """positions, normals, colors: (v, 3). faces: (f, 3) into them."""

    positions: FloatArray
    normals: FloatArray
    colors: FloatArray
    faces: Ints


@dataclass(frozen=True, eq=False)
class Tapers:
    """Stems made straight between the m nodes that are left of them, one's after the other's.

    at: (m, 3). girth: (m,), 0 at a point. color: (m, 3, 4) its mean, and its change towards each
    axis of space. stem: (m,). facing: (m, 3) normal of a flat one, 0 of round ones.
    """

    at: FloatArray
    girth: FloatArray
    color: FloatArray
    stem: Ints
    facing: FloatArray

    def of(self, rows: Ints) -> Tapers:
        """Those of some nodes, whole stems."""
        return Tapers(
            self.at[rows], self.girth[rows], self.color[rows], self.stem[rows], self.facing[rows]
        )


def mesh_of(stems: Stems, choice: Choice) -> Mesh:
    """All that is drawn."""
    meshes = [
        Mesh(lump.positions, lump.normals, lump.colors, lump.faces) for _, lump in choice.lumps
    ]
    if (choice.wider > 0).any():
        tapers = straightened(stems, choice)
        for index, section in enumerate(SECTIONS):
            rows = np.flatnonzero((choice.section == index)[tapers.stem])
            if len(rows):
                meshes.append(swept(tapers.of(rows), section))
    before = np.cumsum([0, *(len(mesh.positions) for mesh in meshes[:-1])])
    return Mesh(
        np.concatenate([mesh.positions for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.colors for mesh in meshes]),
        np.concatenate([mesh.faces + b for mesh, b in zip(meshes, before, strict=True)]),
    )


def straightened(stems: Stems, choice: Choice) -> Tapers:
    """The stems that are drawn, each with the surface that it shows."""
    shown = choice.wider > 0
    kept = np.zeros(len(stems.node), dtype=bool)
    kept[stems.first[shown]] = kept[stems.last[shown]] = True
    kept[stems.spans.middle[choice.halved]] = True
    node = np.flatnonzero(kept)
    stem = stems.stem[node]
    at = joined(stems, node, shown)[node]
    inner = stem[1:] == stem[:-1]

    def around(values: FloatArray) -> FloatArray:
        """Of values (n, ...), the sums between the nodes before and after each one that is left."""
        total = np.diff(np.cumsum(values, axis=0)[node], axis=0)
        total[~inner] = 0.0
        none = np.zeros_like(values[:1])
        return np.asarray(np.concatenate([none, total]) + np.concatenate([total, none]))

    surface = around(stems.area)
    color = around(np.concatenate([stems.color[:, :, None], stems.swing], axis=2))
    color /= np.maximum(surface, TINY)[:, None, None]
    length = np.where(inner, np.linalg.norm(np.diff(at, axis=0), axis=1), 0.0)
    whole = np.bincount(stem, surface, len(stems)) / 2
    least = LEAST * whole / np.maximum(np.bincount(stem[1:], length, len(stems)), TINY)
    girth = np.maximum(stems.girth[node], least[stem])
    girth[choice.pointed[stem] & (node == stems.last[stem])] = 0.0
    for _ in range(FITTING):
        taper = taper_areas(girth, length)
        made = np.append(0.0, taper) + np.append(taper, 0.0)
        girth = girth * np.divide(surface, made, out=np.ones_like(girth), where=made > 0)
    for _ in range(FITTING):
        made = np.bincount(stem[1:], taper_areas(girth, length), len(stems)).astype(float)
        girth = girth * np.divide(whole, made, out=np.ones_like(made), where=made > 0)[stem]
    return Tapers(at, girth * choice.wider[stem], color, stem, stems.facing[stem])


def joined(stems: Stems, node: Ints, shown: Bools) -> FloatArray:
    """(n, 3) the stems' nodes, starts moved on to the straight lines, between the nodes that are
    left, of the stems that they grow from, where those are drawn."""
    at = stems.node.copy()
    depth = np.zeros(len(stems), dtype=np.int64)
    above = stems.host
    while (above >= 0).any():
        depth += above >= 0
        above = np.where(above >= 0, stems.host[above], -1)
    grows = shown & (stems.host >= 0) & shown[stems.host]
    for level in np.unique(depth[grows]):
        child = np.flatnonzero(grows & (depth == level))
        end, part = stems.host_node[child], stems.host_part[child][:, None]
        foot = stems.node[end - 1] * (1 - part) + stems.node[end] * part
        after = np.searchsorted(node, end)
        a, b = node[after - 1], node[after]
        line = stems.node[b] - stems.node[a]
        square = np.maximum((line**2).sum(axis=1), TINY)
        along = np.clip(((foot - stems.node[a]) * line).sum(axis=1) / square, 0, 1)[:, None]
        at[stems.first[child]] = at[a] * (1 - along) + at[b] * along
    return at


def swept(tapers: Tapers, section: Section) -> Mesh:
    """Tapers with one section."""
    at, girth, k = tapers.at, tapers.girth, section.points
    inner = tapers.stem[1:] == tapers.stem[:-1]
    tangent = tangents(at, inner)
    u = transported(tangent, tapers)
    v = np.cross(tangent, u)
    angle = 2 * np.pi * np.arange(k) / k
    out = np.cos(angle)[:, None] * u[:, None] + np.sin(angle)[:, None] * v[:, None]
    if k == 2:  # a sheet of half the surface; the sides of a prism together have all of it
        reach, normals, turn = 0.25, np.repeat(v[:, None], 2, axis=1), 0.0
    else:
        reach, normals, turn = 1 / (2 * k * np.sin(np.pi / k)), out, 2.0
    swing = np.einsum("mcd,mkd->mkc", tapers.color[:, :, 1:], out)  # of a sine over half a turn
    colors = np.maximum(tapers.color[:, None, :, 0] + turn * swing, 0.0)
    side = np.arange(section.sides)
    a = np.flatnonzero(inner)[:, None] * k
    a0, a1 = a + side, a + (side + 1) % k
    blunt = girth[1:][inner] > 0
    lower = np.stack([a0, a1, a0 + k], axis=-1)
    upper = np.stack([a1, a1 + k, a0 + k], axis=-1)[blunt]
    return Mesh(
        (at[:, None] + reach * girth[:, None, None] * out).reshape(-1, 3),
        normals.reshape(-1, 3),
        colors.reshape(-1, 3),
        np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)]),
    )


def tangents(at: FloatArray, inner: Bools) -> FloatArray:
    """(m, 3) unit vectors along lines, halfway between the steps before and after each node."""
    step = unit(np.diff(at, axis=0)) * inner[:, None]
    none = np.zeros((1, 3))
    before, after = np.concatenate([none, step]), np.concatenate([step, none])
    both = before + after
    turns_back = np.linalg.norm(both, axis=1) < 1e-6
    both[turns_back] = after[turns_back]
    still = ~both.any(axis=1)
    both[still] = [0.0, 1.0, 0.0]
    return unit(both)


def transported(tangent: FloatArray, tapers: Tapers) -> FloatArray:
    """(m, 3) unit vectors across the tangents, turned as little as the stems bend. Flat stems start
    facing their way, others each at an angle of its own, so that ribbons face all ways."""
    first, last = ends(np.unique(tapers.stem, return_inverse=True)[1])
    along, facing = tangent[first], tapers.facing[first]
    u = unit(np.cross(along, np.eye(3)[np.abs(along).argmin(axis=1)]))
    angle = (2 * np.pi * (tapers.stem[first] * GOLDEN % 1))[:, None]
    own = np.cos(angle) * u + np.sin(angle) * np.cross(along, u)
    flat = np.cross(facing, along)
    is_flat = np.linalg.norm(flat, axis=1) > 1e-6
    across = np.zeros_like(tangent)
    across[first] = np.where(is_flat[:, None], unit(flat), own)
    for nth in range(1, int((last - first).max(initial=0)) + 1):
        here = (first + nth)[first + nth <= last]
        before, t = across[here - 1], tangent[here]
        left = before - (before * t).sum(axis=1)[:, None] * t
        still = np.linalg.norm(left, axis=1) < 1e-6
        left[still] = np.cross(t[still], np.eye(3)[np.abs(t[still]).argmin(axis=1)])
        across[here] = unit(left)
    return across
