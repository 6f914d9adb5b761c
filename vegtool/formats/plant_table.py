"""What is known of each plant of a tile, for clients that ask: which, of what species, how high.

Sources: EXT_structural_metadata (property tables, 3D Metadata Specification 1.0), EXT_mesh_features
and EXT_instance_features (Cesium, OGC 22-025r4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vegtool.arrays import IntArray, SingleArray
from vegtool.formats.glb import Document

METADATA, INSTANCE_FEATURES = "EXT_structural_metadata", "EXT_instance_features"
MESH_FEATURES = "EXT_mesh_features"
ALIGNMENT = 8
"""Bytes that columns begin at multiples of."""
CLASS = "plant"


@dataclass(frozen=True, eq=False)
class PlantTable:
    """n plants. id: (n,) int64. species: (n,) int32 of `names`. height: (n,) float32 metres."""

    id: npt.NDArray[np.int64]
    species: IntArray
    height: SingleArray
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.id)

    def only(self, which: npt.NDArray[np.int64]) -> PlantTable:
        """These plants alone, in their order."""
        return PlantTable(self.id[which], self.species[which], self.height[which], self.names)


def add_tables(document: Document, tables: Sequence[PlantTable]) -> None:
    """Add tables to a document, one at least, all of the same names of species."""
    document.use_extension(METADATA)
    named = [{"name": name, "value": index} for index, name in enumerate(tables[0].names)]
    properties = {
        "id": {
            "name": "Which plant it is",
            "description": "Row of an inventory, or a number of its own.",
            "type": "SCALAR", "componentType": "INT64", "required": True,
        },
        "species": {"name": "Species", "type": "ENUM", "enumType": "species", "required": True},
        "height": {
            "name": "Height", "description": "Metres.", "type": "SCALAR",
            "componentType": "FLOAT32", "required": True,
        },
    }  # fmt: skip
    schema = {
        "id": "plants",
        "classes": {CLASS: {"name": "Plant", "properties": properties}},
        "enums": {"species": {"name": "Species", "valueType": "UINT16", "values": named}},
    }
    written = [
        {
            "class": CLASS,
            "count": len(table),
            "properties": {
                key: {"values": document.add_view(values.tobytes(), alignment=ALIGNMENT)}
                for key, values in (
                    ("id", table.id.astype("<i8")),
                    ("species", table.species.astype("<u2")),
                    ("height", table.height.astype("<f4")),
                )
            },
        }
        for table in tables
    ]
    document.extend(METADATA, {"schema": schema, "propertyTables": written})


def of_instances(document: Document, table: int, count: int) -> dict[str, Any]:
    """The extension of a node whose i-th instance is the i-th plant of a table."""
    document.use_extension(INSTANCE_FEATURES)
    return {INSTANCE_FEATURES: {"featureIds": [{"featureCount": count, "propertyTable": table}]}}


def of_vertices(document: Document, table: int, count: int) -> dict[str, Any]:
    """The extension of a primitive whose attribute _FEATURE_ID_0 says which plant of a table each
    vertex is of."""
    document.use_extension(MESH_FEATURES)
    ids = {"featureCount": count, "attribute": 0, "propertyTable": table}
    return {MESH_FEATURES: {"featureIds": [ids]}}


def vertex_ids(plant: npt.NDArray[np.int64]) -> npt.NDArray[Any]:
    """Which plant each vertex is of, (v,), as that attribute: exact to 16,777,216 plants."""
    kind = np.uint16 if not len(plant) or plant.max() < 65536 else np.float32
    return plant.astype(kind)
