"""Pictures of what was measured of progressive blue surfels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from blue.landscape import SHOWN_PX
from blue.orders import Orders
from blue.prefixes import MODELS, PREFIXES, Scores, Shown
from vegtool.arrays import Picture
from vegtool.measure.background import bytes_over
from vegtool.surfels.blue.distances import relative

VIOLINS = (1_000, 5_000, 10_000)
"""Points of prefixes of figure 3, of orders of as many as the last."""
TITLES = {"random": "random", "randomised": "paper's", "ours": "ours", "exact": "exact"}
STYLES = {
    "random": ("#888888", "random"),
    "randomised": ("#e69f00", "paper's"),
    "ours, single": ("#56b4e9", "ours, single pixels"),
    "ours": ("#0072b2", "ours"),
}
NAMES = {"flip": "FLIP, less is better", "ssim": "SSIM, more is better"}
GAP, LINE, QUALITY = 8, 20, 84
PAPER, INK = (250, 250, 248), (30, 34, 38)


def violins(file: Path, found: Orders) -> None:
    """Figure 3's plots, with the box between the quartiles."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.8), layout="constrained")
    some, places = found.of(VIOLINS[-1]), found.pictured.found.position
    panels = figure.subplots(1, len(VIOLINS), sharey=True)
    for axes, prefix in zip(panels, VIOLINS, strict=True):
        data = [relative(places[some[name].first[:prefix]], found.area) for name in TITLES]
        axes.violinplot(data, showextrema=True, widths=0.8)
        axes.boxplot(data, widths=0.12, showfliers=False, whis=0.0, showcaps=False)
        axes.set_xticks(range(1, len(TITLES) + 1), list(TITLES.values()))
        axes.set_title(f"{prefix:,} points")
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylim(0)
    panels[0].set_ylabel("relative distance to the nearest other")
    figure.savefig(file, dpi=110)


def errors(file: Path, found: Sequence[Scores]) -> None:
    """Error against points, discs as asked."""
    from matplotlib.figure import Figure

    asked = [one for one in found if one.factor is None]
    figure = Figure(figsize=(10, 5.6), layout="constrained")
    panels = figure.subplots(len(NAMES), len(MODELS), sharex=True, sharey="row")
    for row, (key, name) in zip(panels, NAMES.items(), strict=True):
        for axes, model in zip(row, MODELS, strict=True):
            for order, (color, label) in STYLES.items():
                those = [s for s in asked if s.model == model and s.order == order]
                values = [one.means[key] for one in those]
                axes.plot([one.points for one in those], values, "o-", ms=3, color=color,
                          label=label)  # fmt: skip
            axes.set(xscale="log", xlim=(PREFIXES[0], PREFIXES[-1]))
            axes.spines[["top", "right"]].set_visible(False)
        row[0].set_ylabel(name)
    for axes, model in zip(panels[0], MODELS, strict=True):
        axes.set_title(model)
    for axes in panels[-1]:
        axes.set_xlabel("points")
    panels[0][-1].legend(frameon=False)
    figure.savefig(file, dpi=110)


def sheet(file: Path, found: Mapping[str, Sequence[Shown]]) -> None:
    """Prefixes as large as the original, figure 4's; below, as large as each is meant for, beside
    the original."""
    rows = []
    for name, some in found.items():
        large = [Image.fromarray(bytes_over(one.large)) for one in some]
        large.append(Image.fromarray(bytes_over(some[0].large_truth)))
        small = [_pair(one.own, one.own_truth) for one in some]
        told = [f"{name}, {one.points:,} points" for one in some] + [f"{name}, original"]
        rows.append((told, large, small))
    width = max(one.width for _, large, _ in rows for one in large)
    heights = [(large[0].height, max(s.height for s in small)) for _, large, small in rows]
    size = (
        GAP + len(rows[0][1]) * (width + GAP),
        GAP + sum(LINE + high + GAP + low + 2 * GAP for high, low in heights),
    )
    paper = Image.new("RGB", size, PAPER)
    pen, font, top = ImageDraw.Draw(paper), ImageFont.load_default(14), GAP
    for (told, large, small), (high, low) in zip(rows, heights, strict=True):
        for column, (text, picture) in enumerate(zip(told, large, strict=True)):
            left = GAP + column * (width + GAP)
            pen.text((left, top), text, fill=INK, font=font)
            paper.paste(picture, (left, top + LINE))
            if column < len(small):
                paper.paste(small[column], (left, top + LINE + high + GAP))
        top += LINE + high + GAP + low + 2 * GAP
    paper.save(file, quality=QUALITY)


def parts_of(file: Path, found: Mapping[tuple[str, str], Picture]) -> None:
    """Of each view, a row of the same part of it, drawn in each way; the truth first."""
    (width, height), drawn = SHOWN_PX, ["truth"]
    drawn += [name for _, name in found if name not in ("truth", "whole")]
    drawn, views = list(dict.fromkeys(drawn)), list(dict.fromkeys(view for view, _ in found))
    size = (
        GAP + len(drawn) * (width + GAP),
        GAP + len(views) * (LINE + height + GAP),
    )
    paper = Image.new("RGB", size, PAPER)
    pen, font = ImageDraw.Draw(paper), ImageFont.load_default(14)
    for (i, view), (j, name) in product(enumerate(views), enumerate(drawn)):
        left, top = GAP + j * (width + GAP), GAP + i * (LINE + height + GAP)
        whole = Image.fromarray(bytes_over(found[view, name]))
        x, y = (whole.width - width) // 2, (whole.height - height) // 2
        pen.text((left, top), f"{view}, {name}", fill=INK, font=font)
        paper.paste(whole.crop((x, y, x + width, y + height)), (left, top + LINE))
    paper.save(file, quality=QUALITY)


def _pair(left: Picture, right: Picture) -> Image.Image:
    """Side by side."""
    a, b = Image.fromarray(bytes_over(left)), Image.fromarray(bytes_over(right))
    both = Image.new("RGB", (a.width + b.width, a.height), PAPER)
    both.paste(a, (0, 0))
    both.paste(b, (a.width, 0))
    return both
