"""What benchmarks/preview.py found, as rows for its files of results and tables for its page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from walk.scenes import SETTINGS, Setting
from walk.speed import Walked
from walk.tradeoff import Point
from walk.transition import Changes
from walk.truth import Error

Row = dict[str, object]

TITLES = {
    "speed": "### Frames, plants, vertices, memory",
    "truth": "### FLIP against the truth",
    "tradeoff": "### Error against the time of a frame",
    "transition": "### From level to level",
}


def speed_rows(found: Sequence[Walked]) -> list[Row]:
    """For results/preview_speed.csv."""
    return [
        {
            "scene": w.walk.scene,
            "drawn": w.walk.name,
            "frames": w.frames,
            "median_fps": f"{w.fps:.3g}",
            "worst_fps": f"{w.worst_fps:.3g}",
            "plants": w.plants,
            "of": w.total,
            "triangles": w.triangles,
            "vertices": w.vertices,
            "detail": f"{w.detail:.4f}" if w.detail <= 1 else "",
            "peak_mb": w.peak_mb,
        }
        for w in found
    ]


def truth_rows(found: Sequence[Error]) -> list[Row]:
    """For results/preview_truth.csv: over stations."""
    rows: list[Row] = []
    for scene, drawn in dict.fromkeys((e.scene, e.drawn) for e in found):
        some = [e for e in found if (e.scene, e.drawn) == (scene, drawn)]
        flips = np.array([e.flip for e in some])
        rows.append(
            {
                "scene": scene,
                "drawn": drawn,
                "detail": f"{some[0].detail:.4f}" if some[0].detail else "",
                "stations": len(some),
                "median": f"{np.median(flips):.4f}",
                "least": f"{flips.min():.4f}",
                "most": f"{flips.max():.4f}",
            }
        )
    return rows


def tradeoff_rows(found: Sequence[Point]) -> list[Row]:
    """For results/preview_tradeoff.csv."""
    return [
        {
            "scene": p.scene,
            "view": p.station,
            "drawn": p.drawn,
            "detail": f"{p.detail:.4f}" if p.detail else "",
            "ms": f"{1e3 * p.seconds:.1f}",
            "plants": p.plants,
            "triangles": p.triangles,
            "flip": f"{p.flip:.4f}",
        }
        for p in found
    ]


def transition_rows(found: Sequence[Changes]) -> list[Row]:
    """For results/preview_transition.csv."""
    return [
        {
            "levels": c.library,
            "plant": c.species,
            "fade": c.fade,
            "speed_m_s": f"{c.speed_m_s:g}",
            "level": c.transition.level,
            "start_m": f"{c.transition.start_m:.2f}",
            "end_m": f"{c.transition.end_m:.2f}",
            "steps": c.steps,
            "pairs": len(c.ratios),
            "still": c.still,
            "coverage": f"{c.coverage - 1:+.4f}",
            **_spread(c.ratios),
        }
        for c in found
    ]


def transition_summary(found: Sequence[Changes]) -> list[Row]:
    """Every plant with every fade, all transitions and speeds together."""
    rows: list[Row] = []
    for key in dict.fromkeys((c.library, c.species, c.fade) for c in found):
        some = [c for c in found if (c.library, c.species, c.fade) == key]
        worst = max(some, key=lambda c: abs(c.coverage - 1))
        ratios = np.concatenate([c.ratios for c in some])
        rows.append(
            {
                **dict(zip(("levels", "plant", "fade"), key, strict=True)),
                "pairs": len(ratios),
                "still": sum(c.still for c in some),
                "coverage": f"{worst.coverage - 1:+.1%}",
                "at": f"LOD{worst.transition.level}",
                **_spread(ratios),
            }
        )
    return rows


def _spread(ratios: Sequence[float] | np.ndarray) -> Row:
    median, high = np.percentile(ratios, [50, 95])
    return {"median": f"{median:.2f}", "p95": f"{high:.2f}", "most": f"{max(ratios):.2f}"}


def mix(setting: Setting) -> str:
    """A sentence on what grows where."""
    parts = [
        f"{100 * kind.share:g} % {name} ({kind.height_m[0]:g} to {kind.height_m[1]:g} m)"
        for name, kind in setting.kinds.items()
    ]
    side = f"{setting.side_m:g} x {setting.side_m:g} m"
    return f"- {setting.name}: {setting.plants:,} plants on {side}: {', '.join(parts)}"


def sections(found: Mapping[str, Sequence[Row]]) -> dict[str, str]:
    """The text of the page by part: of the landscapes, and a table for each that was measured."""
    told = {part: f"{TITLES[part]}\n\n{table(rows)}" for part, rows in found.items() if rows}
    return {"landscapes": "\n".join(mix(setting) for setting in SETTINGS.values()), **told}


def table(rows: Sequence[Row]) -> str:
    """Rows of the same columns, as markdown."""
    columns = list(rows[0])
    lines = [f"| {' | '.join(c.replace('_', ' ') for c in columns)} |", "|---" * len(columns) + "|"]
    lines += [f"| {' | '.join(_cell(row[c]) for c in columns)} |" for row in rows]
    return "\n".join(lines)


def _cell(value: object) -> str:
    return f"{value:,}" if isinstance(value, int) else str(value)
