"""One OpenGL context for everything that is drawn without a window.

OpenGL 3.3 core, so that the same shaders run on Mesa's software rasteriser, on any GPU, and on
macOS (4.1). On Linux the context comes from EGL and needs neither a display nor a GPU.
"""

from __future__ import annotations

import shutil
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from platform import system
from types import TracebackType
from typing import Any, Self
from weakref import WeakKeyDictionary

import moderngl

from vegtool.errors import CapabilityError

REQUIRED_VERSION = 330
LINUX_PACKAGES = (
    ("apt-get", "sudo apt-get install libegl1 libgl1"),
    ("dnf", "sudo dnf install mesa-libEGL mesa-libGL mesa-dri-drivers"),
    ("pacman", "sudo pacman -S mesa libglvnd"),
    ("zypper", "sudo zypper install Mesa-libEGL1 Mesa-libGL1 Mesa-dri"),
    ("apk", "sudo apk add mesa-egl mesa-gl mesa-dri-gallium"),
)


class OnGpu(ABC):
    """What holds something on the GPU: a context manager, leaving which releases it."""

    @abstractmethod
    def release(self) -> None:
        """Free everything on the GPU."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.release()


@dataclass(frozen=True)
class ContextInfo:
    """What draws here. version: as the driver words it; max_texture: texels along one side."""

    vendor: str
    renderer: str
    version: str
    max_texture: int
    software: bool


_described: WeakKeyDictionary[moderngl.Context, ContextInfo] = WeakKeyDictionary()


@cache
def context() -> moderngl.Context:
    """The process's context without a window, made on the first call.

    Raises CapabilityError, naming the one command that helps, where there is no OpenGL 3.3.
    """
    settings: dict[str, Any] = {"require": REQUIRED_VERSION, "standalone": True}
    if system() == "Linux":
        settings["backend"] = "egl"
    try:
        made = moderngl.create_context(**settings)
    except Exception as error:  # glcontext raises bare Exception for all it cannot do
        raise CapabilityError(
            f"OpenGL 3.3 without a window is needed and was not found ({error}). {remedy()}"
        ) from error
    made.gc_mode = "auto"
    return made


@contextmanager
def framebuffer_kept(ctx: moderngl.Context) -> Iterator[None]:
    """Bind what was bound before, also inside a window: GL is asked, not moderngl's memory.

    A framebuffer that is released while bound leaves moderngl with a name that GL no longer knows.
    """
    before = ctx.detect_framebuffer()
    _ = ctx.error  # of a multisampled one it asks more than OpenGL tells
    try:
        yield
    finally:
        before.use()


def check(ctx: moderngl.Context) -> None:
    """Raise CapabilityError where OpenGL refused something since the last check.

    It says nothing by itself and goes on, with a wrong picture. An enum that a driver does not
    know is a matter of its version, and draws nothing wrong.
    """
    if (error := ctx.error) not in ("GL_NO_ERROR", "GL_INVALID_ENUM"):
        raise CapabilityError(
            f"OpenGL refused to draw ({error}): the plant or its pictures are larger than "
            f"{describe(ctx).renderer} can hold. Use a plant of fewer triangles or smaller "
            "textures, or allow less with --max-texture."
        )


def remedy() -> str:
    """The sentence that says what to install on this machine."""
    if system() == "Linux":
        for manager, command in LINUX_PACKAGES:
            if shutil.which(manager):
                return f"Install it with: {command}"
        return "Install Mesa's EGL library and its drivers with your package manager."
    return "Update the graphics driver."


def describe(ctx: moderngl.Context | None = None) -> ContextInfo:
    """Vendor, renderer, version and limits of `ctx`, by default of the shared context."""
    ctx = ctx or context()
    if ctx not in _described:
        info = ctx.info
        renderer = str(info["GL_RENDERER"])
        software = any(name in renderer.lower() for name in ("llvmpipe", "softpipe", "swiftshader"))
        _described[ctx] = ContextInfo(
            vendor=str(info["GL_VENDOR"]),
            renderer=renderer,
            version=str(info["GL_VERSION"]),
            max_texture=int(info["GL_MAX_TEXTURE_SIZE"]),
            software=software,
        )
        _ = ctx.error  # moderngl asks for more than every driver knows
    return _described[ctx]
