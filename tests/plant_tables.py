"""A property table of a .glb file, read as its own schema says."""

from __future__ import annotations

import numpy as np

from vegtool.formats.gltf_data import GltfFile


def columns(file: GltfFile, table: int) -> dict[str, np.ndarray]:
    """A table's columns, by the classes and the enums that the file itself has."""
    metadata = file.json["extensions"]["EXT_structural_metadata"]
    asked = metadata["propertyTables"][table]
    properties = metadata["schema"]["classes"][asked["class"]]["properties"]
    found = {}
    for name, column in asked["properties"].items():
        told = properties[name]
        if told["type"] == "ENUM":
            enum = metadata["schema"]["enums"][told["enumType"]]
            kind = {"UINT16": "<u2"}[enum["valueType"]]
        else:
            kind = {"INT64": "<i8", "FLOAT32": "<f4"}[told["componentType"]]
        view = file.json["bufferViews"][column["values"]]
        assert view["byteOffset"] % 8 == 0 and "target" not in view
        assert file.binary is not None
        data = file.binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        found[name] = np.frombuffer(data, kind)
        assert len(found[name]) == asked["count"]
        if told["type"] == "ENUM":
            by_value = {one["value"]: one["name"] for one in enum["values"]}
            found[name] = np.array([by_value[value] for value in found[name]])
    return found
