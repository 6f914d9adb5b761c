"""What a report compares, declared once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from vegtool.clustering import METHODS
from vegtool.convert import MOST_BILLBOARDS, SURFELS, ConvertOptions
from vegtool.display import Display
from vegtool.errors import UsageError
from vegtool.measure.options import MeasureOptions
from vegtool.options import option, same_option

FAMILIES: Mapping[str, ConvertOptions] = {
    "refined": ConvertOptions(),
    "hybrid": ConvertOptions(method="hybrid"),
    "surfel-billboards": ConvertOptions(method="surfel-billboards"),
    "surfels": ConvertOptions(method=SURFELS),
    **{method: ConvertOptions(refine="none", method=method) for method in METHODS},
}
"""What is compared, and by which options `convert` makes it."""
SURFELS_PER_BILLBOARD = 64
"""Of a budget: about as many bytes as a billboard and its share of an atlas."""


@dataclass(frozen=True)
class ReportOptions:
    """Which rows a report has. The command line makes its flags from these fields.

    Raises UsageError for a method or a budget that is none.
    """

    methods: str = option(
        ",".join(FAMILIES), "Methods to compare, with commas between.", metavar="NAME,..."
    )
    budgets: str = option(
        "16,64,256,1024",
        f"Billboards of each method, with commas between; or {SURFELS_PER_BILLBOARD} times as many "
        "surfels.",
        metavar="N,...",
    )
    views: str = same_option(MeasureOptions, "views")
    view_count: int = option(12, "Directions that every error is a mean over.", least=1, most=1000)
    max_error: float | None = same_option(MeasureOptions, "max_error")
    max_pixels: float | None = same_option(MeasureOptions, "max_pixels")
    fov: float = same_option(ConvertOptions, "fov")
    image_height: int = same_option(ConvertOptions, "image_height")
    seed: int = same_option(ConvertOptions, "seed")

    def __post_init__(self) -> None:
        _ = self.method_names, self.budget_counts

    @property
    def display(self) -> Display:
        """For whom distances are stated."""
        return Display(self.fov, self.image_height)

    @property
    def method_names(self) -> tuple[str, ...]:
        """The methods, in the order given."""
        names = _words(self.methods)
        wrong = [name for name in names if name not in FAMILIES]
        if wrong or not names:
            found = ", ".join(wrong) or "none"
            raise UsageError(f"--methods: expected some of {', '.join(FAMILIES)}; got {found}")
        return names

    @property
    def budget_counts(self) -> tuple[int, ...]:
        """The budgets, smallest first."""
        words = _words(self.budgets)
        wrong = [word for word in words if not _is_budget(word)]
        if wrong or not words:
            found = ", ".join(wrong) or "none"
            raise UsageError(
                f"--budgets: expected whole numbers from 1 to {MOST_BILLBOARDS:,} with commas "
                f"between, such as 16,64,256; got {found}"
            )
        return tuple(sorted({int(word) for word in words}))


def _is_budget(word: str) -> bool:
    return word.isdecimal() and len(word) < 10 and 1 <= int(word) <= MOST_BILLBOARDS


def _words(text: str) -> tuple[str, ...]:
    """The words between commas, each once."""
    return tuple(dict.fromkeys(word.strip() for word in text.split(",") if word.strip()))
