"""Draws docs/conifer.jpg, the README's picture: the contact sheet of the conifer sample.

.venv/bin/python samples/readme_picture.py
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

from PIL import Image

from vegtool.convert import convert
from vegtool.growth import sample
from vegtool.measure.contact_sheet import contact_sheet

PICTURE = Path(__file__).resolve().parent.parent / "docs" / "conifer.jpg"


def main() -> None:
    sheet = Image.open(BytesIO(contact_sheet(convert(sample("conifer")))))
    sheet.convert("RGB").save(PICTURE, quality=88, optimize=True)


if __name__ == "__main__":
    main()
