"""Leaves that let light through."""

from __future__ import annotations

from dataclasses import replace

from vegtool.plant import Plant


def translucent(plant: Plant, share: float) -> Plant:
    """The plant with leaves that let that share of light through, 0 to 1, whatever its file says.

    It takes the leaf's own colour; a tint that the file gives stays.
    """
    materials = tuple(
        replace(material, transmission=share) if material.role == "leaf" else material
        for material in plant.materials
    )
    return replace(plant, materials=materials)
