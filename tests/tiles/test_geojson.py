"""Points with properties: degrees by the standard, metres by the habit of some programs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_csv import rows_of
from tile_cases import TWO_SPECIES

from vegtool.errors import InputError
from vegtool.tiles.rows import Rows

SCENE = TWO_SPECIES + '\n[placement]\ninventory = "trees.geojson"\n'


def collection(*points: tuple[list[float], dict[str, Any]], **more: Any) -> dict[str, Any]:
    features = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": position},
            "properties": properties,
        }
        for position, properties in points
    ]
    return {"type": "FeatureCollection", "features": features, **more}


def read(folder: Path, document: Any, more: str = "") -> Rows:
    text = document if isinstance(document, str) else json.dumps(document)
    return rows_of(folder, text, more, "trees.geojson", SCENE)


def test_points_in_degrees(tmp_path: Path) -> None:
    rows = read(
        tmp_path,
        collection(
            ([10.5, 53.5], {"species": "ash", "height": 12, "x": "not a place"}),
            ([10.6, 53.6, 4.0], {"species": "pine", "height": None, "id": 3}),
        ),
    )
    assert rows.columns.geographic
    assert (rows.x.tolist(), rows.y.tolist()) == ([10.5, 10.6], [53.5, 53.6])
    assert rows.species.tolist() == [0, 1]
    assert rows.height[0] == 12 and np.isnan(rows.height[1])
    assert np.isnan(rows.z).all(), "not all have one"
    assert rows.notes[0].endswith("columns that are not used: x, id")


def test_points_in_metres(tmp_path: Path) -> None:
    """As the 2008 version of the format may name them, or as they must be."""
    place = ([565_000.25, 5_930_000.5, 3.0], {"kind": "ash", "h_cm": "250", "rotation": 180})
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}
    for more in ({"crs": crs}, {}):
        rows = read(tmp_path, collection(place, **more))
        assert not rows.columns.geographic
        assert (rows.x[0], rows.y[0], rows.z[0]) == (565_000.25, 5_930_000.5, 3)
        assert (rows.height[0], rows.yaw[0]) == (2.5, pytest.approx(np.pi))
        assert len(rows.notes) == (not more)
    assert rows.notes[0].endswith("coordinates are no degrees, so they are taken as metres")


@pytest.mark.parametrize(
    ("name", "crs"),
    [
        ("urn:ogc:def:crs:OGC:1.3:CRS84", "OGC:CRS84"),
        ("urn:ogc:def:crs:EPSG::4258", "EPSG:4258"),
        ("EPSG:25832", "EPSG:25832"),
        ("urn:ogc:def:crs:EPSG:6.9:25832", "EPSG:25832"),
        ("my own", None),
    ],
)
def test_maps(tmp_path: Path, name: str, crs: str | None) -> None:
    """A file that names none has longitude and latitude."""
    place = ([10.5, 53.5], {"species": "ash"})
    named = {"type": "name", "properties": {"name": name}}
    found = read(tmp_path, collection(place, crs=named)).columns
    assert found.crs == crs and found.geographic == (crs in ("OGC:CRS84", "EPSG:4258"))
    found = read(tmp_path, collection(place)).columns
    assert found.crs == "OGC:CRS84" and found.geographic


def test_chosen_columns_are_on_a_map_of_their_own(tmp_path: Path) -> None:
    """What the format says of its coordinates says nothing of properties."""
    place = ([10.5, 53.5], {"species": "ash", "rechts": 565_000, "hoch": 5_930_000})
    rows = read(tmp_path, collection(place), 'columns = { x = "rechts", y = "hoch" }')
    assert (rows.x[0], rows.columns.crs, rows.columns.geographic) == (565_000, None, False)


def test_a_property_may_be_chosen_in_place_of_a_coordinate(tmp_path: Path) -> None:
    document = collection(([10.5, 53.5, 7.0], {"species": "ash", "ground": 99}))
    assert read(tmp_path, document).z[0] == 7
    assert read(tmp_path, document, 'columns = { z = "ground" }').z[0] == 99


@pytest.mark.parametrize(
    ("document", "says"),
    [
        ("{", "trees.geojson: expected GeoJSON; Expecting"),
        ("[1]", "trees.geojson: expected a GeoJSON FeatureCollection, found none; export the poi"),
        (collection(), "trees.geojson: expected a point for each plant, found none; add"),
        (
            collection(([1, 2], {"species": "ash"}), ([1, 2], {"species": "oak"})),
            "trees.geojson, feature 2, column species: expected one of ash, pine, found 'oak'",
        ),
        (
            collection(([1, 2], {"species": "ash", "height": "high"})),
            "trees.geojson, feature 1, column height: expected a number, found 'high'",
        ),
        (
            collection(([1, 2], {"species": "ash", "height": 9000})),
            "feature 1, column height: expected 0 to 150 m, found 9000; say the column's unit",
        ),
        (
            collection(([1, 2], {"species": ["ash"]})),
            "feature 1, column species: expected one of ash, pine, found '[\"ash\"]'; correct it",
        ),
        (
            collection(([1, 2], {"species": "ash", "height": {"m": 2}})),
            "feature 1, column height: expected a number, found '{\"m\": 2}'; correct or remove",
        ),
        (
            {
                "features": [
                    {"geometry": {"type": "Point", "coordinates": [1, 2]}, "properties": [1]}
                ]
            },
            "feature 1: expected properties with names, found [1]; correct or remove it",
        ),
        (
            collection(([1, 2], {"species": "ash", "height": True})),
            "feature 1, column height: expected a number, found 'true'; correct or remove",
        ),
        (
            collection(([1], {"species": "ash"})),
            "feature 1: expected two or three numbers as coordinates, found [1]; correct or remo",
        ),
        (
            collection(([float("nan"), 2], {"species": "ash"})),
            "feature 1, column coordinates[0]: expected a number, found nan; correct or remove",
        ),
        (
            collection(([1, float("inf")], {"species": "ash"})),
            "feature 1, column coordinates[1]: expected a number, found inf; correct or remove",
        ),
        (
            collection(([10**400, 2], {"species": "ash"})),
            "feature 1, column coordinates[0]: expected a number, found 1000000",
        ),
        (
            {"features": [{"geometry": {"type": "Polygon", "coordinates": []}}]},
            "trees.geojson, feature 1: expected a Point, found Polygon; remove it, or export poin",
        ),
        (
            {"features": [{"geometry": None, "properties": {}}]},
            "trees.geojson, feature 1: expected a Point, found no geometry; remove it",
        ),
    ],
)
def test_documents_that_are_no_inventory(tmp_path: Path, document: Any, says: str) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, document)
    assert says in str(caught.value).replace(f"{tmp_path}/", "")
