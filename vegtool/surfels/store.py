"""A model of surfel billboards as a file of its own, NAME.surfels: an .npz that numpy loads.

Everything that frames are drawn from, so that a viewer chooses anew for each. Arrays have the names
and dtypes of the classes that they are of (model.py); images are PNG files; all else is in `about`,
as JSON.
"""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from vegtool.errors import InputError, UsageError
from vegtool.formats import png
from vegtool.formats.archive import archived
from vegtool.formats.images import MAX_SIDE, decode
from vegtool.lod import Atlas, Display
from vegtool.options import check_limits
from vegtool.plant import Material, Plant, Texture
from vegtool.surfels.bake import SurfelAtlas
from vegtool.surfels.box import SurfelBoxes
from vegtool.surfels.hierarchy import SurfelHierarchy
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.multi_triangulation import MultiTriangulation
from vegtool.surfels.options import SurfelOptions

VERSION = 1
"""Of the file: one more when a reader of the last one would misread it."""
MOST_BYTES = 2**33
"""Of all arrays: a file that claims more is not unpacked."""

OF_PLANT = ("positions", "normals", "uvs")
MAYBE_OF_PLANT = ("colors", "exposure")
OF_TRIANGLES = ("faces", "first", "material", "start", "end", "error", "center", "radius")
OF_HIERARCHY = ("father", "error", "center", "radius", "above")
OF_BOXES = ("center", "axes", "half")
OF_MATERIAL = {
    "name": str,
    **{
        f.name: type(f.default)
        for f in fields(Material)
        if isinstance(f.default, str | float | bool)
    },
}
IMAGES = ("color_texture", "normal_texture", "light_texture")


def surfels_bytes(model: SurfelModel) -> bytes:
    """The file of a model: the same model, the same bytes."""
    plant, one, textures = model.plant, model.hierarchy, model.textures
    arrays: dict[str, np.ndarray] = {}
    for name in (*OF_PLANT, *MAYBE_OF_PLANT):
        if getattr(plant, name) is not None:
            arrays[f"plant_{name}"] = getattr(plant, name)
    arrays["plant_faces"], arrays["plant_face_material"] = plant.faces, plant.face_material
    arrays |= {f"triangles_{name}": getattr(model.triangles, name) for name in OF_TRIANGLES}
    arrays |= {f"billboards_{name}": getattr(one, name) for name in OF_HIERARCHY}
    arrays |= {f"boxes_{name}": getattr(one.boxes, name) for name in OF_BOXES}
    atlas = textures.atlas
    assert atlas.normal is not None
    arrays |= {"front": atlas.front, "back": atlas.back, "behind": textures.behind}
    for name, pixels in (("color", atlas.color), ("normal", atlas.normal), ("depth", atlas.depth)):
        arrays[f"atlas_{name}"] = _bytes(png.encode(pixels))
    seen: dict[int, int] = {}
    materials = []
    for material in plant.materials:
        told: dict[str, Any] = {
            item.name: getattr(material, item.name) for item in fields(material)
        }
        for name in IMAGES:
            texture = told[name]
            if texture is None:
                continue
            number = seen.setdefault(id(texture), len(seen))
            arrays[f"image_{number}"] = _bytes(png.encode_texture(texture)[0])
            told[name] = [number, texture.name]
        materials.append(told)
    about = {
        "version": VERSION,
        "name": plant.name,
        "materials": materials,
        "theta": one.theta,
        "least": one.least,
        "display": asdict(model.display),
        "options": asdict(model.options),
        "notes": list(model.notes),
    }
    text = json.dumps(about, default=lambda value: value.tolist())
    return archived({"about": _bytes(text.encode()), **arrays}, compressed=True)


def read_surfels(path: Path) -> SurfelModel:
    """The model in a file. Raises InputError for one that is missing, broken, or of another
    version."""
    try:
        arrays = _arrays(path)
        about = json.loads(arrays["about"].tobytes(), parse_constant=_refused)
        if about["version"] != VERSION:
            raise InputError(
                f"{path}: expected version {VERSION} of surfel billboards, found "
                f"{about['version']!r}. {_AGAIN}"
            )
        return _model(path, arrays, about)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror or error}); check the path"
        ) from error
    except _BROKEN as error:
        raise InputError(
            f"{path}: expected surfel billboards as `vegtool convert --method surfel-billboards` "
            f"writes them; the file is broken ({error or type(error).__name__}). {_AGAIN}"
        ) from error


_AGAIN = "Convert the plant again."
_BROKEN = (
    ValueError, TypeError, LookupError, AttributeError, ArithmeticError, EOFError, SyntaxError,
    RuntimeError, MemoryError, zipfile.BadZipFile, zlib.error, UsageError,
)  # fmt: skip
"""What numpy, zipfile, zlib, json and Pillow say of a file that is not what it should be, and what
is said of options out of range."""


def _refused(constant: str) -> None:
    raise ValueError(f"{constant} among its numbers")


def _arrays(path: Path) -> dict[str, np.ndarray]:
    with zipfile.ZipFile(path) as archive:
        total = sum(info.file_size for info in archive.infolist())
        if total > MOST_BYTES:
            raise ValueError(f"{total:,} bytes of arrays")
        return {
            info.filename.removesuffix(".npy"): np.lib.format.read_array(
                io.BytesIO(archive.read(info)), allow_pickle=False
            )
            for info in archive.infolist()
        }


def _model(path: Path, arrays: dict[str, np.ndarray], about: dict[str, Any]) -> SurfelModel:
    def texture(place: list[Any] | None) -> Texture | None:
        if place is None:
            return None
        number, name = place
        return decode(arrays[f"image_{number}"].tobytes(), name, f"{path}: image {name}")

    def pixels(name: str) -> np.ndarray:
        from PIL.PngImagePlugin import PngImageFile  # of any size: `Image.open` has a limit

        try:
            with PngImageFile(io.BytesIO(arrays[f"atlas_{name}"].tobytes())) as image:
                if max(image.size) > MAX_SIDE:
                    raise ValueError(f"{image.width} x {image.height} texels of {name}")
                return np.asarray(image)
        except OSError as error:  # of the picture, not of the file
            raise ValueError(f"{name}: {error}") from error

    images: dict[str, Texture | None] = {}
    materials = []
    for told in about["materials"]:
        for name in IMAGES:
            key = json.dumps(told[name])
            if key not in images:
                images[key] = texture(told[name])
            told[name] = images[key]
        told |= {name: kind(told[name]) for name, kind in OF_MATERIAL.items()}
        materials.append(Material(**told))
    of_plant: dict[str, Any] = {name: arrays[f"plant_{name}"] for name in OF_PLANT}
    of_plant |= {name: arrays.get(f"plant_{name}") for name in MAYBE_OF_PLANT}
    plant = Plant(
        name=str(about["name"]), faces=arrays["plant_faces"],
        face_material=arrays["plant_face_material"], materials=tuple(materials), source=str(path),
        **of_plant,
    )  # fmt: skip
    mt = MultiTriangulation(plant, **{name: arrays[f"triangles_{name}"] for name in OF_TRIANGLES})
    boxes = SurfelBoxes(**{name: arrays[f"boxes_{name}"] for name in OF_BOXES})
    one = SurfelHierarchy(
        boxes, theta=about["theta"], least=about["least"],
        **{name: arrays[f"billboards_{name}"] for name in OF_HIERARCHY},
    )  # fmt: skip
    options = SurfelOptions(**{name: float(value) for name, value in about["options"].items()})
    check_limits(options)
    front, back = arrays["front"], arrays["back"]
    atlas = Atlas(pixels("color"), pixels("normal"), pixels("depth"), front, back)
    return SurfelModel(
        mt, one, SurfelAtlas(atlas, arrays["behind"]), Display(**about["display"]),
        options, tuple(about["notes"]),
    )  # fmt: skip


def _bytes(data: bytes) -> np.ndarray:
    return np.frombuffer(data, np.uint8)
