"""Drawn textures: tileable bark with a normal map, and leaves with a clean edge.

Bark is noise made by shaping the spectrum of white noise, which tiles by itself. Leaves are drawn
as outlines (a width along the midrib) with veins and a gradient, and colour that goes on under
alpha 0, so that no dark rim shows where a client filters.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import numpy as np

from vegtool.arrays import ByteArray, FloatArray
from vegtool.growth.species import Bark, Foliage
from vegtool.plant import Texture
from vegtool.seeding import generator

SIZE = 512  # pixels of every texture, each way
CELLS = 2  # drawings per row and column of a leaf texture
CELL_MARGIN = 0.015  # of a cell, kept clear of the next drawing


@lru_cache(maxsize=16)
def bark_textures(bark: Bark) -> tuple[Texture, Texture]:
    """Colour and tangent-space normals, (SIZE, SIZE) pixels, tileable both ways."""
    rng = generator(0, "bark", *bark.colors)
    coarse = tileable_noise(SIZE, 5.0 * np.sqrt(bark.stretch), 5.0 / np.sqrt(bark.stretch), rng)
    middle = tileable_noise(SIZE, 14.0 * np.sqrt(bark.stretch), 14.0 / np.sqrt(bark.stretch), rng)
    fine = tileable_noise(SIZE, 70.0, 40.0, rng)
    furrow = np.abs(coarse + 0.45 * middle)
    height = np.clip(1.0 - np.exp(-2.2 * furrow), 0, 1) + 0.06 * fine
    height = (height - height.min()) / np.ptp(height)
    shade = np.clip(1.15 * height + 0.1 * fine + 0.06 * middle, 0, 1)[..., None]
    dark, light = (srgb_of(c) for c in bark.colors)
    color = dark + (light - dark) * shade
    slope_x = (np.roll(height, -1, 1) - np.roll(height, 1, 1)) * 9 * bark.relief
    slope_y = (np.roll(height, -1, 0) - np.roll(height, 1, 0)) * 9 * bark.relief
    # Image rows run down while the tangent space's second axis runs up.
    normal = np.stack([-slope_x, slope_y, np.ones_like(height)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return (
        Texture("bark", _opaque(color)),
        Texture("bark_normal", _opaque(normal * 0.5 + 0.5)),
    )


def tileable_noise(size: int, across: float, along: float, rng: np.random.Generator) -> FloatArray:
    """(size, size) noise of unit deviation whose features repeat `across` and `along` times."""
    frequency = np.fft.fftfreq(size, 1 / size)
    x, y = frequency[None, :] / across, frequency[:, None] / along
    band = np.sqrt(x * x + y * y)
    gain = band * np.exp(1 - band * band)
    noise = np.fft.ifft2(np.fft.fft2(rng.normal(size=(size, size))) * gain).real
    return np.asarray(noise / noise.std())


@lru_cache(maxsize=16)
def leaf_texture(species: str, index: int, kind: Foliage) -> Texture:
    """The drawings of one kind of foliage, CELLS x CELLS of them, roots at the bottom."""
    cell = SIZE // CELLS
    image = np.zeros((SIZE, SIZE, 4))
    for number in range(CELLS * CELLS):
        row, column = divmod(number, CELLS)
        rng = generator(0, "leaf", species, index, number)
        canvas = Canvas(cell)
        DRAWINGS[kind.texture](canvas, kind, rng)
        image[row * cell :, column * cell :][:cell, :cell] = canvas.pixels
    return Texture(f"{species}_{kind.texture.replace(' ', '_')}", finish(image))


class Canvas:
    """A square image, (0, 0) in the middle of its lower edge, 1 high and 1 wide, y up."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.pixels = np.zeros((size, size, 4))  # straight colour, alpha
        middle = (np.arange(size) + 0.5) / size
        self.x, self.y = np.meshgrid(middle - 0.5, 1 - middle)

    def paint(self, window: tuple[slice, slice], color: FloatArray, cover: FloatArray) -> None:
        """Lay colour (h, w, 3) over the window, as much as cover (h, w) says."""
        target = self.pixels[window]
        below = target[..., 3] * (1 - cover)
        alpha = cover + below
        some = alpha > 0
        share = np.divide(cover, alpha, out=np.zeros_like(cover), where=some)[..., None]
        target[..., :3] = np.where(
            some[..., None], color * share + target[..., :3] * (1 - share), target[..., :3]
        )
        target[..., 3] = alpha

    def around(self, points: FloatArray, margin: float) -> tuple[slice, slice]:
        """The window that holds the points (n, 2) and that margin."""
        low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
        columns = np.clip(((np.array([low[0], high[0]]) + 0.5) * self.size), 0, self.size)
        rows = np.clip((1 - np.array([high[1], low[1]])) * self.size, 0, self.size)
        return (
            slice(int(rows[0]), int(np.ceil(rows[1]))),
            slice(int(columns[0]), int(np.ceil(columns[1]))),
        )


def draw_leaf(
    canvas: Canvas,
    kind: Foliage,
    root: tuple[float, float],
    angle: float,
    length: float,
    rng: np.random.Generator,
) -> None:
    """One leaf from `root`, `angle` radians from upright, with midrib, veins and teeth."""
    heading = np.array([np.sin(angle), np.cos(angle)])
    right = np.array([heading[1], -heading[0]])
    base = np.array(root)
    reach = np.stack([base, base + heading * length])
    window = canvas.around(reach, length * kind.slimness * 0.7)
    dx, dy = canvas.x[window] - base[0], canvas.y[window] - base[1]
    along = (dx * heading[0] + dy * heading[1]) / length
    bow = rng.normal(0, 0.06)  # a leaf is never quite straight
    across = (dx * right[0] + dy * right[1]) / length - bow * np.sin(np.pi * np.clip(along, 0, 1))
    s = np.clip(along, 1e-6, 1 - 1e-6)
    half = 0.5 * kind.slimness * np.sin(np.pi * s**0.72) ** 0.85
    if kind.teeth:
        half = half * (1 - 0.16 * ((s * kind.teeth) % 1.0) * (1 - s))
    inside = np.minimum(half - np.abs(across), np.minimum(along, 1 - along) * 0.8)
    cover = np.clip(inside * length * canvas.size + 0.5, 0, 1)
    dark, light, rib = (srgb_of(c) for c in kind.colors)
    edge = np.clip(np.abs(across) / np.maximum(half, 1e-3), 0, 1)
    tone = 0.35 + 0.35 * s + rng.normal(0, 0.14) - 0.22 * edge + 0.10 * np.sign(across)
    veins = np.abs(((along - 0.9 * np.abs(across)) * 8.0) % 1.0 - 0.5)
    tone = tone + 0.16 * np.clip(1 - veins * 7, 0, 1) * (1 - edge)
    color = dark + (light - dark) * np.clip(tone, 0, 1)[..., None]
    midrib = np.clip(1 - np.abs(across) * length * canvas.size / (1.6 * (1.2 - s)), 0, 1)
    color = color + (rib - color) * (0.75 * midrib)[..., None]
    canvas.paint(window, color, cover)


def draw_stalk(
    canvas: Canvas, start: FloatArray, end: FloatArray, width: float, color: FloatArray
) -> None:
    """A straight stalk between two points, `width` of the canvas wide."""
    window = canvas.around(np.stack([start, end]), 2 * width)
    dx, dy = canvas.x[window] - start[0], canvas.y[window] - start[1]
    span = end - start
    share = np.clip((dx * span[0] + dy * span[1]) / (span @ span), 0, 1)
    away = np.hypot(dx - share * span[0], dy - share * span[1])
    cover = np.clip((width / 2 - away) * canvas.size + 0.5, 0, 1)
    canvas.paint(window, np.broadcast_to(color, (*cover.shape, 3)), cover)


def draw_broad_twig(canvas: Canvas, kind: Foliage, rng: np.random.Generator) -> None:
    """Leaves alternating along a twig, the last one at its tip."""
    stalk = srgb_of("#5b4a2c")
    sway = rng.normal(0, 0.05)
    tip = 0.58
    at = np.linspace(0, 1, 7)
    spine = np.stack([sway * np.sin(np.pi * at), at * tip], axis=1)
    for start, end in pairwise(spine):
        draw_stalk(canvas, start, end, 0.014, stalk)
    pairs = kind.leaves - 1
    for number in range(pairs):
        share = 0.16 + 0.80 * number / max(pairs - 1, 1)
        x = sway * np.sin(np.pi * share)
        hand = 1 if number % 2 else -1
        angle = hand * np.radians(68 - 34 * share + rng.normal(0, 7))
        length = (0.44 - 0.06 * abs(share - 0.4)) * rng.uniform(0.88, 1.08)
        draw_leaf(canvas, kind, (x, share * tip), float(angle), float(length), rng)
    draw_leaf(canvas, kind, (0.0, tip - 0.02), float(rng.normal(0, 0.08)), 0.40, rng)


def draw_needle_twig(canvas: Canvas, kind: Foliage, rng: np.random.Generator) -> None:
    """A twig with side twigs, set with needles all along."""
    dark, light, wood = (srgb_of(c) for c in kind.colors)
    twigs = [(np.array([0.0, 0.0]), np.array([rng.normal(0, 0.01), 0.90]))]
    for number in range(kind.leaves):
        share = 0.10 + 0.68 * number / max(kind.leaves - 1, 1)
        hand = 1 if number % 2 else -1
        angle = hand * np.radians(46 + rng.normal(0, 5))
        start = np.array([0.0, 0.9 * share])
        length = (0.46 - 0.30 * share) * rng.uniform(0.85, 1.1)
        twigs.append((start, start + length * np.array([np.sin(angle), np.cos(angle)])))
    for start, end in twigs:
        draw_stalk(canvas, start, end, 0.012, wood)
    for start, end in twigs:
        span = end - start
        size = float(np.hypot(*span))
        heading = np.arctan2(span[0], span[1])
        for share in np.arange(0.04, 1.0, 0.014 / size):
            for hand in (-1, 1):
                angle = heading + hand * np.radians(rng.normal(48 - 22 * share, 8))
                length = rng.uniform(0.065, 0.095) * (1 - 0.35 * share**3)
                root = start + span * share
                point = root + length * np.array([np.sin(angle), np.cos(angle)])
                color = dark + (light - dark) * np.clip(rng.normal(0.45, 0.25), 0, 1)
                draw_stalk(canvas, root, point, 0.0085, color)


def draw_single_leaf(canvas: Canvas, kind: Foliage, rng: np.random.Generator) -> None:
    """One leaf on a short stalk."""
    draw_stalk(canvas, np.array([0.0, 0.0]), np.array([0.0, 0.14]), 0.025, srgb_of(kind.colors[2]))
    draw_leaf(canvas, kind, (0.0, 0.10), 0.0, 0.88, rng)


def draw_flower(canvas: Canvas, kind: Foliage, rng: np.random.Generator) -> None:
    """Petals around a heart, in the middle of the cell."""
    draw_petals(canvas, kind, (0.0, 0.5), kind.leaves, 0.47, rng)


def draw_petals(
    canvas: Canvas,
    kind: Foliage,
    centre: tuple[float, float],
    petals: int,
    length: float,
    rng: np.random.Generator,
) -> None:
    """`petals` of that length around a heart."""
    heart = srgb_of(kind.colors[2])
    plain = Foliage(
        1, 1, 1, "", colors=(kind.colors[0], kind.colors[1], kind.colors[1]), slimness=kind.slimness
    )
    turn = rng.uniform(0, 6)
    for number in range(petals):
        angle = turn + 2 * np.pi * number / petals + rng.normal(0, 0.05)
        draw_leaf(canvas, plain, centre, float(angle), length * rng.uniform(0.92, 1.0), rng)
    middle = np.array(centre)
    draw_stalk(canvas, middle, middle + np.array([0.0, 1e-3]), 0.22 * length / 0.47, heart)


def draw_blossom_twig(canvas: Canvas, kind: Foliage, rng: np.random.Generator) -> None:
    """Flowers of five petals on stalks, left and right of a twig."""
    bark = srgb_of("#4d382c")
    share = np.linspace(0, 1, kind.leaves)
    hand = np.where(np.arange(kind.leaves) % 2, 1, -1)
    flowers = np.stack([hand * rng.uniform(0.03, 0.3, kind.leaves), 0.18 + 0.64 * share], axis=1)
    roots = np.stack([np.zeros(kind.leaves), 0.7 * share], axis=1)
    for root, flower in zip(roots, flowers, strict=True):
        draw_stalk(canvas, root, flower, 0.012, bark)
    draw_stalk(canvas, np.zeros(2), np.array([0.0, 0.72]), 0.018, bark)
    for x, y in rng.permutation(flowers).tolist():
        draw_petals(canvas, kind, (x, y), 5, float(rng.uniform(0.13, 0.16)), rng)


def draw_blade(canvas: Canvas, kind: Foliage, rng: np.random.Generator) -> None:
    """A strip of grass or of a frond, filling the cell."""
    dark, light, rib = (srgb_of(c) for c in kind.colors)
    stripes = rng.normal(0, 1, canvas.size)
    stripes = np.convolve(np.r_[stripes, stripes[:8]], np.ones(9) / 9, "valid")[: canvas.size]
    tone = 0.15 + 0.65 * canvas.y + 0.25 * stripes[None, :]
    color = dark + (light - dark) * np.clip(tone, 0, 1)[..., None]
    midrib = np.clip(1 - np.abs(canvas.x) * 14, 0, 1)[..., None]
    color = color + (rib - color) * 0.7 * midrib
    canvas.paint((slice(None), slice(None)), color, np.ones_like(canvas.x))


DRAWINGS = {
    "broad twig": draw_broad_twig,
    "blossom twig": draw_blossom_twig,
    "needle twig": draw_needle_twig,
    "leaf": draw_single_leaf,
    "flower": draw_flower,
    "blade": draw_blade,
}


def srgb_of(color: str) -> FloatArray:
    """(3,) sRGB values 0 to 1 of "#rrggbb"."""
    return np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0


def finish(image: FloatArray) -> ByteArray:
    """(h, w, 4) bytes, each clear pixel with the colour of the nearest drawn one."""
    from scipy.ndimage import distance_transform_edt

    clear = image[..., 3] < 0.5 / 255
    if clear.any():
        row, column = distance_transform_edt(clear, return_distances=False, return_indices=True)
        image[..., :3] = image[row, column, :3]
    return _bytes(image)


def _opaque(color: FloatArray) -> ByteArray:
    return _bytes(np.concatenate([color, np.ones((*color.shape[:2], 1))], axis=-1))


def _bytes(image: FloatArray) -> ByteArray:
    return np.asarray(np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8))
