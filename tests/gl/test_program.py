from __future__ import annotations

import pytest

from vegtool.gl.context import context
from vegtool.gl.program import program, source


def test_includes_are_put_in():
    text = source("picture.frag")
    assert "#include" not in text
    assert "surface_color" in text.partition("void main")[0]


@pytest.mark.gl
def test_a_program_is_compiled_once_per_context_and_variant():
    ctx = context()
    plain = program(ctx, "picture.vert", "picture.frag")
    assert program(ctx, "picture.vert", "picture.frag") is plain
    assert program(ctx, "picture.vert", "picture.frag", "NORMAL_MAP") is not plain
