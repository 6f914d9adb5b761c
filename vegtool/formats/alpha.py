"""What a file's transparency means for a plant: cut out, or opaque.

Sources: glTF 2.0, 3.9.4 Alpha Coverage (cutoff 0.5 by default, ignored outside MASK). Leaves are
cut out, not glass, so BLEND is read as MASK; alpha that hides nothing is read as opaque.
"""

from __future__ import annotations

from vegtool.arrays import FloatArray
from vegtool.plant import AlphaMode, Texture

DEFAULT_CUTOFF = 0.5


def settle_alpha(
    name: str,
    mode: str,
    cutoff: float,
    base_color: FloatArray,
    texture: Texture | None,
    notes: list[str],
) -> tuple[AlphaMode, float, FloatArray]:
    """(alpha mode, cutoff, base colour) of a material whose file says `mode`.

    mode: OPAQUE, MASK, BLEND, or AUTO for formats that only have an alpha channel (OBJ). What is
    guessed is appended to `notes`.
    """
    factor = float(base_color[3])
    alpha = texture.pixels[..., 3] if texture is not None else None
    lowest = factor * (float(alpha.min()) / 255 if alpha is not None else 1.0)
    highest = factor * (float(alpha.max()) / 255 if alpha is not None else 1.0)
    opaque = base_color.copy()
    opaque[3] = 1.0
    if mode == "OPAQUE" or (mode == "MASK" and lowest >= cutoff):
        return "opaque", DEFAULT_CUTOFF, opaque
    if mode == "MASK":
        if highest < cutoff:
            notes.append(
                f"material {name}: its alpha never reaches the cutoff {cutoff:g}, so nothing of it "
                "is visible"
            )
        return "mask", cutoff, base_color
    if lowest == highest:
        if factor < 1:
            notes.append(f"material {name}: even transparency of {factor:.2g} is drawn opaque")
        return "opaque", DEFAULT_CUTOFF, opaque
    if mode == "BLEND":
        notes.append(f"material {name}: blended transparency is read as an alpha mask")
    return "mask", min(DEFAULT_CUTOFF, highest / 2), base_color
