"""A folder that convert wrote, as one page that any browser opens: no network, nothing installed.

The page holds the levels' own files and draws them with three.js, which switches them by the
manifest as a client would. three.js is taken from trimesh's viewer when the page is made.
"""

from __future__ import annotations

import json
import re
from base64 import b64encode
from hashlib import sha256
from html import escape
from importlib import resources
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import vegtool
from vegtool.errors import CapabilityError, InputError
from vegtool.formats.manifest import read_manifest
from vegtool.lighting.light import Light

TRIMESH = ">=4.8.3,<6"
"""Versions of trimesh whose viewer holds that three.js; those before hold r115, which knows no
tangents where light is matt."""
VIEWER = ("resources", "templates", "viewer.zip")
VIEWER_PAGE = "viewer.html.template"
LIBRARY_STARTS = "<script>"
LIBRARY_ENDS = "var camera,controls,scene,renderer,tracklight"  # what follows is trimesh's own
REVISION = 'const e="140"'  # as it stands there; later ones name encodings and lights otherwise
GLB_MAGIC = b"glTF"
LICENCE = """three.js

The MIT License

Copyright © 2010-2022 three.js authors

Permission is hereby granted, free of charge, to any person obtaining a copy of this software and \
associated documentation files (the "Software"), to deal in the Software without restriction, \
including without limitation the rights to use, copy, modify, merge, publish, distribute, \
sublicense, and/or sell copies of the Software, and to permit persons to whom the Software is \
furnished to do so, subject to the following conditions:

The above copyright notice and this permission notice shall be included in all copies or \
substantial portions of the Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT \
NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND \
NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, \
DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT \
OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE."""
"""What three.js asks to be kept; its minified file only names it."""


def web_page(folder: Path) -> bytes:
    """The page (HTML, UTF-8) of all plants in a folder. The same files give the same bytes.

    It is about 0.7 MB larger than 4/3 of the models that it holds. Raises InputError for a folder
    without a manifest, for a broken one, and for one that names a file that is not there, no GLB,
    or outside the folder; CapabilityError where three.js is not to be had.
    """
    manifests = manifests_in(folder)
    library = three_js()
    models: dict[Path, bytes] = {}
    plants = [_plant(path, models) for path in manifests]
    names = [str(plant["name"]) for plant in plants]
    page, style = _resource("web.js"), _resource("web.css")
    parts = {
        "title": escape(names[0] if len(names) == 1 else f"{len(names)} plants"),
        "policy": _policy((library, page), style),
        "version": escape(vegtool.__version__),
        "licence": escape(LICENCE),
        "style": style,
        "library": library,
        "page": page,
        "data": _json({"plants": plants, "light": _light()}),
        "models": "\n".join(
            f'<script type="text/plain" id="model-{i}">{b64encode(model).decode()}</script>'
            for i, model in enumerate(models.values())
        ),
    }
    parts["size"] = f"{sum(map(len, parts.values())) / 1e6:.1f} MB"  # all ASCII, but for names
    # in one pass: what is put in is not looked at again
    text = re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], _resource("web.html"))
    return text.encode(errors="replace")


def manifests_in(folder: Path) -> list[Path]:
    """The manifests in a folder, by name. Raises InputError where there are none."""
    try:
        found = sorted(path for path in folder.iterdir() if path.name.endswith(".lod.json"))
    except OSError as error:
        raise InputError(
            f"{folder}: expected a folder that vegtool convert wrote ({error.strerror}); check the "
            "path"
        ) from error
    if not found:
        raise InputError(
            f"{folder}: expected manifests, NAME.lod.json, in this folder, found none; name the "
            "folder that vegtool convert wrote to (-o)"
        )
    return found


def three_js() -> str:
    """three.js r140 and its reader of glTF, as the text of a script that sets `THREE`.

    Raises CapabilityError where trimesh's viewer does not hold them as expected.
    """
    spec = find_spec("trimesh")  # found, not imported: that takes its time
    places = list(spec.submodule_search_locations or ()) if spec else []
    text = next(filter(None, (_viewer(Path(place).joinpath(*VIEWER)) for place in places)), "")
    start, end = text.find(LIBRARY_STARTS), text.find(LIBRARY_ENDS)
    library = text[start + len(LIBRARY_STARTS) : end] if 0 <= start < end else ""
    whole = all(part in library for part in ("@license", REVISION, "GLTFLoader"))
    # no end tag within, nor what would make a browser look for a second one
    if not whole or re.search(r"</script|<!--", library, re.IGNORECASE):
        raise CapabilityError(
            f"the page needs three.js r140 from the viewer of trimesh {TRIMESH}, found none in "
            f'trimesh {_trimesh_version()}: pip install "trimesh{TRIMESH}"'
        )
    return library


def _viewer(path: Path) -> str:
    """The page of trimesh's viewer, or nothing."""
    try:
        with ZipFile(path) as archive:
            text = archive.read(VIEWER_PAGE).decode()
    except (OSError, KeyError, BadZipFile, UnicodeDecodeError):
        return ""
    return text.replace("\r\n", "\n")  # as a browser reads it, which its digest is for


def _trimesh_version() -> str:
    try:
        return version("trimesh")
    except PackageNotFoundError:
        return "(not installed)"


def _plant(path: Path, models: dict[Path, bytes]) -> dict[str, Any]:
    """What the page is told of a plant: its manifest, each level with the number of its model.

    models: the bytes of files, to which those of this plant are added."""
    values = read_manifest(path)
    kept = ("name", "fov_y_deg", "image_height_px", "extent_m", "sun")
    levels = []
    for level in values["levels"]:
        file = _beside(path, level["file"])
        if file not in models:
            models[file] = _glb(file, path)
        levels.append({**level, "model": list(models).index(file)})
    whole = values.get("scene", {}).get("original", True)
    told = {key: values[key] for key in kept if key in values}
    told = {**told, "original": whole, "levels": levels}
    try:
        _json(told)
    except ValueError as error:
        raise InputError(
            f"{path}: expected finite numbers, found one that is not ({error}); convert the plant "
            "again"
        ) from error
    return told


def _beside(manifest: Path, name: str) -> Path:
    """The file of that name in the manifest's folder, and in no other: it goes into a page that
    others are given."""
    folder = manifest.parent.resolve()
    try:
        found = (folder / name).resolve()
    except (OSError, ValueError):  # a NUL, a loop of links
        found = folder
    if found.parent != folder:
        raise InputError(
            f"{manifest}: expected names of files in its own folder, found {name!r}; convert the "
            "plant again"
        )
    return found


def _glb(path: Path, manifest: Path) -> bytes:
    """The bytes of a level's file."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"{manifest}: names {path.name} as a level, which cannot be read ({error.strerror}); "
            "put it there, or convert the plant again"
        ) from error
    if int.from_bytes(data[8:12], "little") > len(data):
        raise InputError(
            f"{manifest}: names {path.name} as a level, which is cut short; convert the plant again"
        )
    if not data.startswith(GLB_MAGIC):
        raise InputError(
            f"{manifest}: names {path.name} as a level, which was expected to be a GLB and is "
            "something else; convert the plant again"
        )
    return data


def _light() -> dict[str, Any]:
    """The light that errors were measured in."""
    light = Light()
    direction = [float(x) for x in light.unit]
    return {
        "direction": direction,
        "sun": light.sun,
        "sky_above": light.sky_above,
        "sky_below": light.sky_below,
    }


def _policy(scripts: tuple[str, ...], style: str) -> str:
    """A Content-Security-Policy: these scripts, this style, and no connection to anywhere.

    three.js reads a model's images through blob: addresses, which lie within the page.
    """
    allowed = " ".join(map(_digest, scripts))
    return (
        f"default-src 'none'; script-src {allowed}; style-src {_digest(style)}; img-src blob:; "
        "connect-src blob:; base-uri 'none'; form-action 'none'"
    )


def _digest(text: str) -> str:
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"


def _json(values: Any) -> str:
    """JSON that may stand in a script element: no `<` begins a tag there."""
    return json.dumps(values, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _resource(name: str) -> str:
    return resources.files("vegtool.preview").joinpath(name).read_text(encoding="utf-8")
