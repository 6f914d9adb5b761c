"""The page that shows a folder: it needs nothing else, holds what was written, trusts nobody."""

from __future__ import annotations

import json
import zipfile
from base64 import b64decode, b64encode
from collections.abc import Callable
from dataclasses import dataclass, field
from hashlib import sha256
from html.parser import HTMLParser
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plants import plant_of

from vegtool.errors import CapabilityError, InputError
from vegtool.formats.gltf import write_chain
from vegtool.lod import Display, Level, LodChain
from vegtool.preview import web
from vegtool.preview.web import three_js, web_page

TRIANGLES = np.random.default_rng(0).random((8, 3, 3))


def write(folder: Path, name: str = "oak") -> None:
    """A chain of two levels, both meshes."""
    fine, coarse = plant_of(TRIANGLES), plant_of(TRIANGLES[:4])
    levels = (Level("mesh", mesh=fine), Level("mesh", mesh=coarse, near_distance_m=10.0))
    write_chain(LodChain(name, levels, Display(), 0), folder)


def edit(folder: Path, change: Callable[[dict[str, Any]], None], name: str = "oak") -> None:
    path = folder / f"{name}.lod.json"
    values = json.loads(path.read_bytes())
    change(values)
    path.write_text(json.dumps(values))


@dataclass
class Element:
    tag: str
    attributes: dict[str, str | None]
    text: str = ""


@dataclass
class Parsed(HTMLParser):
    """A page as a browser reads it: elements in order, with the text up to the next tag."""

    page: bytes
    elements: list[Element] = field(default_factory=list)
    inside: bool = False

    def __post_init__(self) -> None:
        super().__init__()
        self.feed(self.page.decode())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(Element(tag, dict(attrs)))
        self.inside = True

    def handle_endtag(self, tag: str) -> None:
        self.inside = False

    def handle_data(self, data: str) -> None:
        if self.inside:
            self.elements[-1].text += data

    def all(self, tag: str) -> list[Element]:
        return [e for e in self.elements if e.tag == tag]

    def by_id(self, key: str) -> Element:
        return next(e for e in self.elements if e.attributes.get("id") == key)

    @property
    def scripts(self) -> list[str]:
        """Those that run."""
        return [e.text for e in self.all("script") if "type" not in e.attributes]

    @property
    def data(self) -> dict[str, Any]:
        result: dict[str, Any] = json.loads(self.by_id("data").text)
        return result


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(tmp_path)
    return tmp_path


def test_the_page_asks_for_nothing_outside_itself(folder: Path) -> None:
    page = web_page(folder)
    parsed = Parsed(page)
    for element in parsed.elements:
        assert not element.attributes.keys() & {"src", "href", "srcset", "style", "action"}
        assert not any(name.startswith("on") for name in element.attributes)
    (style,), (library, own) = parsed.all("style"), parsed.scripts
    assert library == three_js()
    rest = page.decode().replace(library, "")
    for word in ("http:", "https:", "url(", "@import", "fetch(", "XMLHttpRequest", "import("):
        assert word not in rest
    policy = next(e for e in parsed.all("meta") if "http-equiv" in e.attributes)
    digests = [b64encode(sha256(s.encode()).digest()).decode() for s in (library, own, style.text)]
    assert policy.attributes["content"] == (
        f"default-src 'none'; script-src 'sha256-{digests[0]}' 'sha256-{digests[1]}'; "
        f"style-src 'sha256-{digests[2]}'; img-src blob:; connect-src blob:; base-uri 'none'; "
        "form-action 'none'"
    )
    assert parsed.elements.index(policy) < parsed.elements.index(style), "what comes first is free"


def test_three_js_comes_with_its_licence_and_without_trimesh_s_viewer(folder: Path) -> None:
    parsed = Parsed(web_page(folder))
    library = parsed.scripts[0]
    assert library.startswith("/**\n * @license\n * Copyright 2010-2022 Three.js Authors\n")
    assert "THREE.GLTFLoader=GLTFLoader" in library
    assert "tracklight" not in library
    licence = parsed.all("pre")[0].text
    assert "Copyright © 2010-2022 three.js authors" in licence
    assert "The above copyright notice and this permission notice shall be included" in licence


def test_models_are_in_it_byte_by_byte(folder: Path) -> None:
    parsed = Parsed(web_page(folder))
    (plant,) = parsed.data["plants"]
    for level in plant["levels"]:
        held = b64decode(parsed.by_id(f"model-{level['model']}").text, validate=True)
        assert held == (folder / level["file"]).read_bytes()
    stated = json.loads((folder / "oak.lod.json").read_bytes())
    assert [{**level, "model": i} for i, level in enumerate(stated["levels"])] == plant["levels"]
    for key in ("name", "fov_y_deg", "image_height_px", "extent_m"):
        assert plant[key] == stated[key]


def test_plants_stand_in_the_order_of_their_names(folder: Path) -> None:
    write(folder, "elm")
    parsed = Parsed(web_page(folder))
    assert [plant["name"] for plant in parsed.data["plants"]] == ["elm", "oak"]
    assert parsed.all("title")[0].text == "2 plants: levels of detail"
    models = [level["model"] for plant in parsed.data["plants"] for level in plant["levels"]]
    assert models == [0, 1, 2, 3]


def test_the_same_folder_gives_the_same_bytes(folder: Path, tmp_path_factory: Any) -> None:
    other = tmp_path_factory.mktemp("other")
    write(other)
    page = web_page(folder)
    assert page == web_page(folder) == web_page(other)
    assert f"This page is {len(page) / 1e6:.1f} MB".encode() in page


@pytest.mark.parametrize(
    "name",
    [
        "</script><script>alert(1)</script>",
        "<!--<script>",
        "</title><img src=x onerror=alert(1)>",
        'a "quoted" & <b>bold</b> oak',
        "{{models}}{{licence}}",
        "\ud800 ünï",
    ],
)
def test_a_name_is_a_name_whatever_it_says(folder: Path, name: str) -> None:
    plain = Parsed(web_page(folder))
    edit(folder, lambda values: values.update(name=name))
    parsed = Parsed(web_page(folder))
    assert [e.tag for e in parsed.elements] == [e.tag for e in plain.elements]
    assert parsed.data["plants"][0]["name"] == name
    seen = name.encode(errors="replace").decode()
    assert parsed.all("title")[0].text == f"{seen}: levels of detail"
    assert parsed.by_id("name").text == seen
    assert parsed.scripts == plain.scripts


@pytest.mark.parametrize(
    "reference", ["../secret.glb", "/etc/passwd", "sub/a.glb", "..", ".", "", "link.glb", "a\0b"]
)
def test_a_file_outside_the_folder_is_refused(tmp_path: Path, reference: str) -> None:
    folder = tmp_path / "out"
    write(folder)
    (tmp_path / "secret.glb").write_bytes(b"glTF")
    (folder / "sub").mkdir()
    (folder / "sub" / "a.glb").write_bytes(b"glTF")
    (folder / "link.glb").symlink_to(tmp_path / "secret.glb")
    edit(folder, lambda values: values["levels"][1].update(file=reference))
    with pytest.raises(InputError, match="expected names of files in its own folder") as caught:
        web_page(folder)
    assert "oak.lod.json" in str(caught.value)
    assert repr(reference) in str(caught.value)


def test_a_file_that_is_not_there_is_named_with_its_manifest(folder: Path) -> None:
    (folder / "oak_LOD1.glb").unlink()
    with pytest.raises(InputError, match=r"oak\.lod\.json: names oak_LOD1\.glb .*cannot be read"):
        web_page(folder)


def test_a_file_that_is_no_glb_is_not_handed_on(folder: Path) -> None:
    (folder / "notes.txt").write_text("private")
    edit(folder, lambda values: values["levels"][1].update(file="notes.txt"))
    with pytest.raises(InputError, match=r"oak\.lod\.json: names notes\.txt .*to be a GLB"):
        web_page(folder)


def test_numbers_that_are_none_are_refused(folder: Path) -> None:
    edit(folder, lambda values: values.update(extent_m=float("nan")))
    with pytest.raises(InputError, match=r"oak\.lod\.json: expected a manifest, found no JSON"):
        web_page(folder)


def test_a_folder_without_manifests_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected manifests, NAME\.lod\.json, in this folder"):
        web_page(tmp_path)
    with pytest.raises(InputError, match="nowhere: expected a folder that vegtool convert wrote"):
        web_page(tmp_path / "nowhere")


@pytest.mark.parametrize(
    "viewer",
    [
        None,
        "no script",
        "<script>/* @license */ r115 GLTFLoader var camera,controls,scene,renderer,tracklight",
        '<script>@license const e="140" GLTFLoader </script> '
        "var camera,controls,scene,renderer,tracklight",
    ],
)
def test_another_trimesh_is_told_from_one_that_serves(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, viewer: str | None
) -> None:
    package = tmp_path / "trimesh"
    if viewer is not None:
        place = package.joinpath(*web.VIEWER)
        place.parent.mkdir(parents=True)
        with zipfile.ZipFile(place, "w") as archive:
            archive.writestr(web.VIEWER_PAGE, viewer)
    spec = ModuleSpec("trimesh", None, is_package=True)
    spec.submodule_search_locations = [str(package)]
    monkeypatch.setattr(web, "find_spec", lambda name: spec)
    with pytest.raises(CapabilityError, match=r'pip install "trimesh>=4\.8\.3,<6"'):
        web_page(folder)
