"""Sample plants from our own generator, seeded, with the branch hierarchy known exactly.

`sample` makes one; `SAMPLES` names them. The parameter files are in samples/species, the way they
are read is in docs/samples.md. Nothing here reads or writes plant models.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vegtool.plant import Plant

SAMPLES: dict[str, str] = {
    "broadleaf": "broadleaf tree, 10 m: alpha-tested cards of several leaves",
    "cherry": "cherry in blossom, 7 m: a bare, forked trunk, cards of flowers",
    "conifer": "conifer, 15 m: alpha-tested cards of needle twigs",
    "bush": "bush, 2 m: several stems, alpha-tested leaf cards",
    "palm": "palm, 8 m: fronds of leaflets as real geometry",
    "dead-tree": "dead tree, 9 m: wood alone",
    "herb": "flowering herb, 0.5 m: one leaf or flower per card",
    "grass-clump": "clump of grass, 0.4 m: blades as real geometry",
    "statue": "closed, smooth solid with fine relief, 2 m; not a plant",
    "height-field": "patch of terrain, 200 m; not a plant",
}


def sample(name: str, triangles: int | None = None, seed: int = 0) -> Plant:
    """Grow the sample `name`.

    triangles: about how many (within 5 %); None for the sample's own default.
    seed: which individual; the same name, triangles and seed give the same plant to the bit.
    Raises UsageError for an unknown name or a number of triangles out of range.
    """
    from vegtool.growth.grow import grow

    return grow(name, triangles, seed)
