"""KHR_draco_mesh_compression: a primitive's attributes out of its compressed bytes, by DracoPy."""

from __future__ import annotations

from typing import Any

import numpy as np

from vegtool.errors import CapabilityError
from vegtool.formats.gltf_data import GltfFile


def decode_draco(
    file: GltfFile, primitive: dict[str, Any]
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """The primitive's attributes by name and its indices, as `GltfFile.accessor` gives them.

    Raises CapabilityError without DracoPy, InputError where the bytes do not decode.
    """
    try:
        import DracoPy
    except ImportError:
        raise CapabilityError(
            f"{file.path}: its meshes are Draco-compressed, and DracoPy, which decodes them, is "
            "not installed; run `pip install vegtool[draco]`"
        ) from None
    extension = primitive["extensions"]["KHR_draco_mesh_compression"]
    try:
        mesh = DracoPy.decode(bytes(file.view(extension["bufferView"])))
        attributes = {
            name: np.asarray(mesh.get_attribute_by_unique_id(identity)["data"])
            for name, identity in extension["attributes"].items()
        }
    except Exception as error:  # whatever the decoder raises, the file is what is wrong
        raise file.broken("Draco-compressed meshes that decode", str(error)) from error
    for name, values in attributes.items():
        if values.ndim == 1:
            attributes[name] = values = values[:, None]
        entry = file.entry("accessors", primitive["attributes"][name])
        if entry.get("normalized") and values.dtype.kind in "iu":
            attributes[name] = np.maximum(values / float(np.iinfo(values.dtype).max), -1.0)
    faces = np.asarray(mesh.faces, dtype=np.uint32).ravel()
    return attributes, faces
