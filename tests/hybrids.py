"""A hybrid level of a plant, made plainly: its leaves as billboards, its wood as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vegtool.baking.bake import bake
from vegtool.boxes import BoxOptions, geometric_error, make_billboards
from vegtool.clustering import cluster
from vegtool.lod import Level
from vegtool.plant import Material, Plant
from vegtool.srgb import linear_from_srgb


def hybrid_of(plant: Plant, billboards: int, texels_per_metre: float) -> Level:
    """At most that many billboards; every wood material is one mean colour."""
    leaf = plant.face_is_leaf
    leaves = replace(
        plant, faces=plant.faces[leaf], face_material=plant.face_material[leaf], branches=None
    )
    labels = np.full(len(plant.faces), -1, np.int32)
    labels[leaf] = cluster(leaves, "kmeans", billboards)
    options = BoxOptions(shape="single", plane="orientation")
    planes = make_billboards(leaves, labels[leaf], options)
    mesh = wood_of(plant)
    return replace(
        bake(plant, labels, planes, texels_per_metre, white=True),
        kind="hybrid",
        mesh=mesh,
        geometric_error_m=geometric_error(plant, labels, planes, mesh, ~leaf),
    )


def wood_of(plant: Plant) -> Plant:
    """The wood, without textures. Its vertices are those of its faces alone."""
    wood = ~plant.face_is_leaf
    vertices, faces = np.unique(plant.faces[wood], return_inverse=True)
    colors = np.ones((len(vertices), 4))
    faces = faces.reshape(-1, 3)
    for index in np.unique(plant.face_material[wood]):
        colors[faces[plant.face_material[wood] == index]] = mean_color(plant.materials[index])
    return Plant(
        "wood",
        plant.positions[vertices],
        plant.normals[vertices],
        np.zeros((len(vertices), 2)),
        faces,
        np.zeros(len(faces), np.int32),
        (Material("wood", double_sided=True),),
        colors=colors,
    )


def mean_color(material: Material) -> np.ndarray:
    """(4,) linear, opaque."""
    color = np.array(material.base_color)
    if material.color_texture is not None:
        texels = linear_from_srgb(material.color_texture.pixels[..., :3] / 255)
        color[:3] *= texels.mean(axis=(0, 1))
    return np.array([*color[:3], 1.0])
