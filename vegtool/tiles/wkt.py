"""What inventories need of a coordinate reference system's description: its code and its unit.

Sources: OGC 01-009 and OGC 18-010r7, well-known text of coordinate reference systems, 1 and 2. Of a
compound system, the horizontal one counts.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

HORIZONTAL = re.compile(r"\b(PROJCS|PROJCRS|GEOGCS|GEOGCRS|GEODCRS)\s*\[", re.IGNORECASE)
CODE = re.compile(r'(?:AUTHORITY|ID)\s*\[\s*"(\w+)"\s*,\s*"?(\d+)"?', re.IGNORECASE)
UNIT = re.compile(r'\b(?:LENGTH)?UNIT\s*\[\s*"([^"]*)"\s*,\s*([\d.]+(?:E[-+]?\d+)?)', re.IGNORECASE)


@dataclass(frozen=True)
class Described:
    """crs: its code, such as EPSG:25832, or the description, where it has none. geographic: whether
    it is of longitude and latitude. unit: name of a map's unit, where that is no metre."""

    crs: str
    geographic: bool
    unit: str | None = None


def described(text: str) -> Described | None:
    """What a description says; None where it is none of a map, or of longitude and latitude."""
    match = HORIZONTAL.search(text)
    if match is None:
        return None
    elements = _elements(text[match.end() :])
    codes = [found for found in map(CODE.match, elements) if found]
    crs = f"{codes[-1][1]}:{codes[-1][2]}".upper() if codes else text
    if match[1].upper().startswith("GEO"):
        return Described(crs, True)
    ends = [one for one in elements if one.upper().startswith(("UNIT", "LENGTHUNIT", "AXIS"))]
    units = [found for found in map(UNIT.search, ends) if found]
    in_metres = not units or float(units[0][2]) == 1.0
    return Described(crs, False, None if in_metres else units[0][1])


def _elements(text: str) -> list[str]:
    """What stands between the commas of a bracket that was opened before."""
    found, depth, quoted = [""], 0, False
    for letter in text:
        quoted ^= letter == '"'
        if not quoted:
            depth += (letter == "[") - (letter == "]")
            if depth < 0:
                break
            if letter == "," and depth == 0:
                found.append("")
                continue
        found[-1] += letter
    return [element.strip() for element in found]
