"""From a sample's name to the plant."""

from __future__ import annotations

import numpy as np

from vegtool.errors import UsageError
from vegtool.growth import SAMPLES
from vegtool.growth.detail import leaf_detail, wood_detail
from vegtool.growth.foliage import foliage
from vegtool.growth.hierarchy import number_branches
from vegtool.growth.mesh import Piece, join
from vegtool.growth.solids import SOLIDS
from vegtool.growth.species import Species, read_species
from vegtool.growth.stems import Stems, first_stems, next_stems
from vegtool.growth.textures import bark_textures, leaf_texture
from vegtool.growth.tubes import tubes
from vegtool.plant import Branches, Material, Plant
from vegtool.seeding import generator

FEWEST, MOST = 100, 10_000_000


def grow(name: str, triangles: int | None, seed: int) -> Plant:
    """See vegtool.growth.sample."""
    if name not in SAMPLES:
        raise UsageError(f"There is no sample '{name}'. There are: {', '.join(SAMPLES)}.")
    if triangles is not None and not FEWEST <= triangles <= MOST:
        raise UsageError(
            f"A sample needs between {FEWEST} and {MOST:,} triangles, not {triangles:,}."
        )
    if name in SOLIDS:
        return SOLIDS[name](triangles, seed)
    return grow_species(name, read_species(name), triangles, seed)


def grow_species(name: str, species: Species, triangles: int | None, seed: int) -> Plant:
    """The plant of a parameter file; `triangles` as in `sample`."""
    triangles = triangles or species.triangles
    skeleton = grow_skeleton(name, species, seed)
    budget = triangles * species.wood_share if species.foliage else triangles
    wood = wood_detail(species, skeleton, budget, generator(seed, name, "detail"))
    numbers, parent, level = number_branches(
        [stems.parent for stems in skeleton],
        [w.drawn | (s.parent < 0) for w, s in zip(wood, skeleton, strict=True)],
    )
    pieces: list[Piece] = []
    for depth, (stems, detail) in enumerate(zip(skeleton, wood, strict=True)):
        chosen = np.flatnonzero(detail.drawn).astype(np.int32)
        pieces += tubes(
            stems,
            chosen,
            detail.sides[chosen],
            detail.segments[chosen],
            numbers[depth][chosen],
            species.bark.tile,
            species.flare if depth == 0 else 0.0,
        )
    left = triangles - sum(len(piece.faces) for piece in pieces)
    materials = [_bark(species)] if any(level.sides for level in species.stems) else []
    for index, kind in enumerate(species.foliage):
        count, segments = leaf_detail(species, kind, triangles, left)
        bearing = kind.levels or (len(skeleton) - 1,)
        lengths = np.array([skeleton[depth].length.sum() for depth in bearing])
        ends = np.rint(np.cumsum(lengths) / lengths.sum() * count).astype(int)
        for depth, share in zip(bearing, np.diff(ends, prepend=0), strict=True):
            pieces.append(
                foliage(
                    kind,
                    skeleton[depth],
                    int(share),
                    kind.count / max(count, 1),
                    segments,
                    numbers[depth],
                    len(materials),
                    generator(seed, name, "foliage", index, depth),
                )
            )
        materials.append(
            Material(
                name=kind.texture.replace(" ", "_"),
                color_texture=leaf_texture(name, index, kind),
                alpha_mode="opaque" if kind.pointed else "mask",
                double_sided=True,
                roughness=0.7,
                role="leaf",
            )
        )
    whole = join(pieces)
    return Plant(
        name=name,
        positions=whole.positions,
        normals=whole.normals,
        uvs=whole.uvs,
        faces=whole.faces,
        face_material=whole.face_material,
        materials=tuple(materials),
        branches=Branches(whole.face_branch, parent, level, "generator"),
        source=f"sample {name}",
    )


def grow_skeleton(name: str, species: Species, seed: int) -> list[Stems]:
    """All stems, one entry per level."""
    skeleton: list[Stems] = []
    for depth, level in enumerate(species.stems):
        rng = generator(seed, name, "stems", depth)
        skeleton.append(next_stems(level, skeleton[-1], rng) if depth else first_stems(level, rng))
    return skeleton


def _bark(species: Species) -> Material:
    color, normal = bark_textures(species.bark)
    return Material(name="bark", color_texture=color, normal_texture=normal, role="wood")
