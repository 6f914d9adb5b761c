"""What was found, in words: for the terminal, for results/quality.csv, for the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from judge.asked import AIM_MEAN, AIM_NEAR, ERRS
from judge.chains import PLAIN
from judge.points import Point, over
from judge.scores import geometric_mean
from judge.sitting import Sitting
from vegtool import __version__


def line(p: Point) -> str:
    """A point on the terminal."""
    flips = "  ".join(f"{what} {drawn.score.flip:.3f}" for what, drawn in p.drawn.items())
    score = p.ours.score
    return (
        f"{p.where:>24}  {flips}  ratio {p.ratio:.2f}  triangles {p.ours.triangles} of {p.most}"
        f"  coverage {score.coverage:+.1%}  colour {score.color:+.1%}"
        f"  silhouette {score.silhouette:.2f}  impostor {p.here:.3f} to its {p.impostor:.3f}"
    )


def summary(points: Sequence[Point]) -> list[str]:
    """Means and worst cases of points from one set of views, beside the aims."""
    far = [p for p in points if p.live >= ERRS]
    near = [p for p in points if p.live < ERRS]
    lines = []
    if far:
        worst = max(far, key=lambda p: p.ratio)
        lines.append(
            f"FLIP over the live original's, where that is {ERRS:g} or more ({len(far)} points): "
            f"geometric mean {geometric_mean([p.ratio for p in far]):.3f} (aim {AIM_MEAN:g}), "
            f"worst {worst.ratio:.3f} ({worst.where})"
        )
    if near:
        worst = max(near, key=lambda p: p.ours.score.flip)
        lines.append(
            f"FLIP where the live original's is less ({len(near)} points): at most "
            f"{worst.ours.score.flip:.3f} ({worst.where}; aim {AIM_NEAR:g})"
        )
    for what in (Sitting.PLAIN, Sitting.REDUCED):
        ratios = over(points, what)
        told = f"geometric mean {geometric_mean(ratios):.3f}" if ratios else "there is none here"
        lines.append(f"FLIP over that of {what}: {told}")
    mean = geometric_mean([p.here / p.impostor for p in points])
    lines.append(f"FLIP over the impostor's, in vegtool's renderer: geometric mean {mean:.3f}")
    for name, title in (("coverage", "coverage"), ("color", "colour")):
        worst = max(points, key=lambda p: abs(getattr(p.ours.score, name)))
        bias = getattr(worst.ours.score, name)
        lines.append(f"largest {title} bias: {bias:+.1%} ({worst.where})")
    return lines


def rows(points: Sequence[Point]) -> list[dict[str, Any]]:
    """Everything drawn in three.js, for results/quality.csv."""
    return [
        {
            "version": __version__,
            "plant": p.plant,
            "drawn": what,
            "options": p.options if what == Sitting.OURS else "",
            "views": p.views,
            "distance": p.distance,
            "triangles": drawn.triangles,
            "texels": drawn.texels,
            "flip": f"{drawn.score.flip:.4f}",
            "coverage": f"{drawn.score.coverage:+.3f}",
            "color": f"{drawn.score.color:+.3f}",
            "silhouette": f"{drawn.score.silhouette:.3f}",
        }
        for p in points
        for what, drawn in p.drawn.items()
    ]


def markdown(points: Sequence[Point], seconds: Mapping[str, tuple[float, float]]) -> str:
    """The table of docs/benchmarks.md, and what follows from it. seconds: as for `costs`."""
    lines = [
        "| plant | radii | triangles | live | vegtool | over live | held out | plain | gltfpack"
        " | vegtool, impostor* | coverage | colour |",
        "|---" * 12 + "|",
    ]
    held_out = {(p.plant, p.distance): f"{p.ratio:.2f}" for p in points if p.views != "standard"}
    for p in points:
        if p.views == "standard":
            flips = {what: f"{drawn.score.flip:.3f}" for what, drawn in p.drawn.items()}
            cells = (
                p.plant,
                f"{p.distance:g}",
                f"{p.ours.triangles:,}",
                flips[Sitting.LIVE],
                f"**{flips[Sitting.OURS]}**",
                f"{p.ratio:.2f}",
                held_out.get((p.plant, p.distance), ""),
                flips.get(Sitting.PLAIN, ""),
                flips.get(Sitting.REDUCED, ""),
                f"{p.here:.3f}, {p.impostor:.3f}",
                f"{p.ours.score.coverage:+.1%}",
                f"{p.ours.score.color:+.1%}",
            )
            lines.append(f"| {' | '.join(cells)} |")
    lines += ["", "\\* both in vegtool's own renderer."]
    chains = {p.plant: f"{p.plant} {p.texels / 1e6:.2f} M (`{p.options}`)" for p in points}
    lines += ["", f"Texels of the whole chain, and options: {', '.join(chains.values())}."]
    if seconds:
        told = [f"{plant} {a:.1f} s and {b:.1f} s" for plant, (a, b) in seconds.items()]
        lines += ["", f"Conversion, and with `{PLAIN}`: {', '.join(told)}."]
    for views in dict.fromkeys(p.views for p in points):
        some = [p for p in points if p.views == views]
        lines += ["", f"From {views} views:", "", *(f"- {words}" for words in summary(some))]
    return "\n".join(lines)
