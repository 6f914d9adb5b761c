"""The manifest NAME.lod.json: which file to draw from which distance, and how wrong it is.

Its keys are described in manifest.schema.json, beside this file, and in docs/manifest.md.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib import resources
from math import isinf
from pathlib import Path
from typing import Any

import vegtool
from vegtool.errors import InputError
from vegtool.formats.ramp import written_texels
from vegtool.limits import Limits
from vegtool.lod import FADE_FRACTION, Level, LodChain, Measured, ShadowProxy, Spread
from vegtool.surfel_set import SurfelSet

VERSION = 1  # of the schema: one more when a reader of the last one would misread the file
DECIMALS = 4  # of an error
STATED = ("flip", "ssim", "coverage_bias", "color_bias")
"""Metrics that a manifest tells of each level."""
OF_SHADOW = ("coverage_bias", "silhouette")
"""Metrics that it tells of what throws the shadow."""

_AGAIN = "Convert the plant again."
_TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "number": (int, float),
    "integer": (int,),
    "boolean": (),
    "null": (type(None),),
}


@dataclass(frozen=True)
class LevelFile:
    """What was written for a level: file name and size in bytes, and the names of the images beside
    it: depth, and Atlas.light as `leaf`."""

    name: str
    bytes: int
    depth: str | None = None
    leaf: str | None = None


MOST_PIXELS = 10**6
"""Of a picture's height."""


def manifest(
    chain: LodChain, files: Sequence[LevelFile], shadow: LevelFile | None = None
) -> dict[str, Any]:
    """The manifest of a chain whose levels were written to `files`, one for each level, in order,
    and what throws its shadow to `shadow`.

    The first is the combined file, which shows the first level wherever MSFT_lod is not read.
    Distances are for `chain.display`; errors are null where they were not measured. The same chain
    gives the same manifest: no time, no path.
    """
    if len(files) != len(chain.levels):
        raise ValueError(f"manifest: {len(chain.levels)} levels need as many files: {len(files)}")
    return {
        "version": VERSION,
        "tool_version": vegtool.__version__,
        "name": chain.name,
        "seed": chain.seed,
        "fov_y_deg": chain.display.fov_y_deg,
        "image_height_px": chain.display.image_height_px,
        "extent_m": extent(chain),
        "options": chain.options,
        "combined": {"file": files[0].name, "bytes": files[0].bytes},
        **({"sun": chain.baked} if chain.baked else {}),
        **({} if chain.shadow is None else {"shadow": _shadow(chain.shadow, shadow)}),
        **({} if chain.limits is None else {"scene": _scene(chain, chain.limits)}),
        "levels": [
            _level(chain, level, file) for level, file in zip(chain.levels, files, strict=True)
        ],
    }


def _scene(chain: LodChain, limits: Limits) -> dict[str, Any]:
    """For which eyes the levels are, and what was left out for that."""
    start, extent_deg = (_short(angle) for angle in limits.azimuth_deg)
    low, high = (_short(angle) for angle in limits.elevation_deg)
    bounds = chain.original.bounds
    return {
        "digest": limits.digest,
        "nearest_m": _short(limits.nearest_m),
        "farthest_m": None if isinf(limits.farthest_m) else _short(limits.farthest_m),
        "azimuth_deg": {"start": start, "extent": extent_deg},
        "elevation_deg": {"low": low, "high": high},
        "fov_y_deg": limits.display.fov_y_deg,
        "image_height_px": limits.display.image_height_px,
        "bounds_m": bounds.tolist(),
        "original": chain.plant is None,
        "left_out": [
            {key: value for key, value in asdict(one).items() if value is not None}
            for one in chain.omitted
        ],
    }


def _short(value: float) -> float:
    """As many digits as are of use."""
    return float(f"{value:.6g}")


def _level(chain: LodChain, level: Level, file: LevelFile) -> dict[str, Any]:
    distance = level.near_distance_m
    fade = float(f"{FADE_FRACTION * distance:.6g}")
    error = level.geometric_error_m
    return {
        "file": file.name,
        "kind": level.kind,
        "triangles": level.triangles,
        "billboards": 0 if level.billboards is None else len(level.billboards),
        **({} if level.surfels is None else {"surfels": _surfels(level.surfels)}),
        "texels": written_texels(level),
        "bytes": file.bytes,
        "switch_distance_m": distance,
        "fade_start_m": distance,
        "fade_end_m": float(f"{distance + fade:.6g}"),
        "hysteresis_m": fade,
        "screen_height_fraction": screen_height_fraction(chain, distance) if distance else None,
        "geometric_error_m": None if error is None else {"max": error[0], "p95": error[1]},
        "measured": None if level.measured is None else _measured(level.measured),
        **({"unlit": True} if level.unlit else {}),
        **({"depth": file.depth} if file.depth else {}),
        **({"leaf": file.leaf} if file.leaf else {}),
    }


def _surfels(surfels: SurfelSet) -> dict[str, Any]:
    return {
        "count": len(surfels),
        "p_m": surfels.spacing.length,
        "r_m": surfels.spacing.radius_m,
    }


def _shadow(proxy: ShadowProxy, file: LevelFile | None) -> dict[str, Any]:
    if file is None:
        raise ValueError("manifest: a chain with a shadow needs its file")
    return {
        "file": file.name,
        "triangles": proxy.level.triangles,
        "texels": written_texels(proxy.level),
        "bytes": file.bytes,
        "pixels": proxy.pixels,
        "suns": proxy.suns,
        **_spreads(proxy.errors, OF_SHADOW),
        "live": _spreads(proxy.live, OF_SHADOW),
    }


def _measured(measured: Measured) -> dict[str, Any]:
    """The errors at the switch distance."""
    held_out = measured.held_out
    return {
        "pixels": float(f"{measured.pixels:.4g}"),
        "views": {"kind": measured.kind, "count": measured.count},
        **_spreads(measured.errors),
        "live": _spreads(measured.live),
        **({} if held_out is None else {"held_out": _spreads({"flip": held_out})}),
    }


def _spreads(
    errors: dict[str, Spread], stated: Sequence[str] = STATED
) -> dict[str, dict[str, float]]:
    """The metrics `stated`, rounded: more digits than the views vouch for are noise."""
    return {
        name: {key: round(value, DECIMALS) + 0.0 for key, value in asdict(errors[name]).items()}
        for name in stated
        if name in errors
    }


def extent(chain: LodChain) -> float:
    """Metres: the original's."""
    return chain.original.extent


def screen_height_fraction(chain: LodChain, distance_m: float) -> float:
    """Share of the image's height that the plant's largest extent covers from that distance."""
    display = chain.display
    return extent(chain) * display.pixels_per_metre(distance_m) / display.image_height_px


def encode(values: dict[str, Any]) -> bytes:
    """A manifest as the bytes of its file."""
    text = json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return text.encode(errors="replace")  # a file name need not be Unicode, JSON must


def read_manifest(path: Path) -> dict[str, Any]:
    """Read NAME.lod.json.

    Raises InputError where the file is missing, is no JSON, has another version than this
    vegtool reads, or lacks a key that it needs.
    """
    try:
        values = json.loads(path.read_bytes(), parse_constant=_no_number)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); expected a manifest, NAME.lod.json, as "
            "vegtool convert writes it."
        ) from error
    except ValueError as error:
        raise InputError(
            f"{path}: expected a manifest, found no JSON ({error}). {_AGAIN}"
        ) from error
    version = values.get("version") if isinstance(values, dict) else None
    if version != VERSION:
        found = "none" if version is None else f"version {version!r}"
        raise InputError(
            f"{path}: expected a manifest of version {VERSION}, found {found}. {_AGAIN}"
        )
    fault = _fault(values, schema(), "") or _display_fault(values)
    if fault:
        raise InputError(f"{path}: {fault}. {_AGAIN}")
    result: dict[str, Any] = values
    return result


def _no_number(word: str) -> None:
    raise ValueError(f"{word} is none of JSON's numbers")


def _fault(value: Any, rule: dict[str, Any], where: str) -> str:
    """The first way in which `value` breaks `rule`, or nothing.

    Knows the words of the schema that a reader's code relies on: type, required, properties,
    items and minItems. (The tests check whole manifests with a complete validator.)
    """
    types = rule.get("type", [])
    types = [types] if isinstance(types, str) else types
    if types and not any(_is(value, name) for name in types):
        return f"{where or 'the manifest'}: expected {' or '.join(types)}, found {value!r:.40}"
    if isinstance(value, dict):
        for key in rule.get("required", []):
            if key not in value:
                return f"{where or 'the manifest'}: lacks the key {key!r}"
        parts = [(k, value[k], r) for k, r in rule.get("properties", {}).items() if k in value]
    elif isinstance(value, list):
        if len(value) < rule.get("minItems", 0):
            return f"{where}: expected at least {rule['minItems']}, found {len(value)}"
        parts = [(str(i), item, rule.get("items", {})) for i, item in enumerate(value)]
    else:
        return ""
    faults = (_fault(part, r, f"{where}.{key}".lstrip(".")) for key, part, r in parts)
    return next(filter(None, faults), "")


def _display_fault(values: dict[str, Any]) -> str:
    """What is wrong with the picture that distances are stated for."""
    fov, height = values["fov_y_deg"], values["image_height_px"]
    if not 0 < fov < 180:
        return f"fov_y_deg: expected more than 0 and less than 180, found {fov!r}"
    if not 1 <= height <= MOST_PIXELS:
        return f"image_height_px: expected 1 to {MOST_PIXELS:,}, found {height!r}"
    return ""


def _is(value: Any, name: str) -> bool:
    """Whether a JSON value has the type that JSON Schema calls `name`."""
    if isinstance(value, bool):
        return name == "boolean"
    return isinstance(value, _TYPES[name])


@cache
def schema() -> dict[str, Any]:
    """The JSON schema (draft 2020-12) of a manifest."""
    text = resources.files("vegtool.formats").joinpath("manifest.schema.json").read_text("utf-8")
    result: dict[str, Any] = json.loads(text)
    return result
