"""Draws docs/samples.jpg: every sample once, as in the table of docs/samples.md.

.venv/bin/python samples/gallery.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from vegtool.gl.draw import Light
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import SAMPLES, sample
from vegtool.measure.background import bytes_over
from vegtool.measure.pictures import truth
from vegtool.measure.views import Camera, direction
from vegtool.plant import Plant

CELL, COLUMNS = 320, 5
FOV = 25.0  # degrees
SKY = (0.60, 0.72, 0.88)  # linear
SUN = Light(direction=np.array([0.35, 0.9, 0.8]), sun=0.95)


def portrait(plant: Plant) -> np.ndarray:
    """(CELL, CELL, 3) uint8: the plant filling the picture."""
    towards = direction(20.0, 8.0)
    right = np.cross([0.0, 1.0, 0.0], towards)
    right /= np.linalg.norm(right)
    offset = plant.positions - plant.center
    half = 1.06 * np.abs(np.stack([offset @ right, offset @ np.cross(towards, right)])).max()
    distance = half / np.tan(np.radians(FOV) / 2) + 0.5 * plant.radius
    focal = CELL / (2 * np.tan(np.radians(FOV) / 2))
    middle = (CELL / 2, CELL / 2)
    camera = Camera(plant.center, towards, distance, focal, CELL, CELL, middle, 1.5 * plant.radius)
    with PlantBuffers(plant) as buffers:
        return bytes_over(truth(buffers, camera, SUN), SKY)


def main() -> None:
    portraits = [portrait(sample(name)) for name in SAMPLES]
    rows = [np.hstack(portraits[i : i + COLUMNS]) for i in range(0, len(portraits), COLUMNS)]
    target = Path(__file__).parent.parent / "docs" / "samples.jpg"
    Image.fromarray(np.vstack(rows)).save(target, quality=88)
    print(target)


if __name__ == "__main__":
    main()
