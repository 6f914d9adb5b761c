from __future__ import annotations

import moderngl
import pytest

from vegtool.errors import CapabilityError
from vegtool.gl import context as room


@pytest.mark.gl
def test_the_context_is_made_once_and_described():
    assert room.context() is room.context()
    info = room.describe()
    assert info.renderer and info.version
    assert info.max_texture >= 1024
    assert room.context().version_code >= room.REQUIRED_VERSION


@pytest.mark.parametrize(
    ("manager", "package"), [("apt-get", "libegl1"), ("dnf", "mesa-libEGL"), (None, "EGL")]
)
def test_without_opengl_the_message_names_what_to_install(monkeypatch, manager, package):
    def refuse(**_):
        raise Exception("libEGL.so not loaded")

    monkeypatch.setattr(moderngl, "create_context", refuse)
    monkeypatch.setattr(room, "system", lambda: "Linux")
    monkeypatch.setattr(room.shutil, "which", lambda name: name if name == manager else None)
    with pytest.raises(CapabilityError, match=package) as caught:
        room.context.__wrapped__()
    assert caught.value.exit_code == 5
    assert "libEGL.so not loaded" in str(caught.value)


@pytest.mark.gl
def test_what_opengl_refuses_in_silence_is_an_error():
    ctx = room.context()
    room.check(ctx)
    ctx.texture((room.describe().max_texture + 1, 1), 4).release()
    with pytest.raises(CapabilityError, match="GL_INVALID_VALUE"):
        room.check(ctx)
    room.check(ctx)
