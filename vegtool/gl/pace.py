"""How much is drawn before what was drawn is waited for.

Mesa's llvmpipe holds every triangle until it has filled its pixels, up to some gigabytes of them,
while its threads fall behind; a GPU takes what it is sent as it comes, and would only idle.
"""

from __future__ import annotations

import moderngl

from vegtool.gl.context import describe

MOST_TRIANGLES = 1_000_000
"""That a software renderer holds."""


class Pace:
    """Counts triangles and waits where there are many, on software renderers."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx, self._software, self._sent = ctx, describe(ctx).software, 0

    @property
    def most(self) -> int:
        """Triangles that a call has at most, unless a single instance has more."""
        return MOST_TRIANGLES if self._software else 2**62

    def sent(self, triangles: int) -> None:
        """Tell of a call with so many."""
        self._sent += triangles
        if self._software and self._sent >= MOST_TRIANGLES:
            self._ctx.finish()
            self._sent = 0
