"""Small plants and billboards, and a plain rasteriser in numpy as the oracle of the bake."""

from __future__ import annotations

import numpy as np

from vegtool.lod import Billboards
from vegtool.plant import Material, Plant, Texture


def texture(pixels) -> Texture:
    return Texture("test", np.asarray(pixels, dtype=np.uint8))


def plain(rgba=(255, 255, 255, 255), **values) -> Material:
    """A material of one colour, sRGB 8 bit."""
    return Material("plain", color_texture=texture([[rgba]]), **{"double_sided": True} | values)


def quads(centers, half=1.0, materials=(None,), face_material=None, normal=(0, 0, 1.0)) -> Plant:
    """Upright squares facing +z, one per centre; texture upright, its top row at +y."""
    corner = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0.0]])
    centers = np.atleast_2d(np.asarray(centers, dtype=float))
    halves = np.broadcast_to(np.asarray(half, dtype=float), len(centers))
    positions = (centers[:, None] + halves[:, None, None] * corner).reshape(-1, 3)
    count = len(centers)
    faces = (4 * np.arange(count)[:, None, None] + [[0, 1, 2], [0, 2, 3]]).reshape(-1, 3)
    if face_material is None:
        face_material = np.zeros(count, dtype=int)
    return Plant(
        "quads",
        positions,
        np.tile(np.asarray(normal, dtype=float), (4 * count, 1)),
        np.tile(uv, (count, 1)),
        faces,
        np.repeat(face_material, 2),
        tuple(m or plain() for m in materials),
    )


def billboards(center, half_size, half_depth=1.0, u=(1.0, 0, 0), v=(0, 1.0, 0)) -> Billboards:
    """One plane per centre, each of its own cluster."""
    center = np.atleast_2d(np.asarray(center, dtype=float))
    n = len(center)
    return Billboards(
        center,
        np.tile(np.asarray(u, dtype=float), (n, 1)),
        np.tile(np.asarray(v, dtype=float), (n, 1)),
        np.broadcast_to(np.asarray(half_size, dtype=float), (n, 2)),
        np.full(n, float(half_depth)),
        np.arange(n),
    )


def leafy(rng: np.random.Generator, faces: int) -> Plant:
    """Random triangles within the unit ball: opaque and cut out, single- and double-sided."""
    corners = rng.uniform(-0.8, 0.8, (faces, 1, 3)) + rng.uniform(-0.35, 0.35, (faces, 3, 3))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    pixels = rng.integers(0, 256, (6, 5, 4))
    materials = (
        plain((200, 120, 40, 255), double_sided=False),
        Material(
            "leaf",
            np.array([0.8, 0.9, 0.5, 0.9]),
            texture(pixels),
            alpha_mode="mask",
            alpha_cutoff=0.4,
            double_sided=True,
            role="leaf",
        ),
    )
    return Plant(
        "leafy",
        corners.reshape(-1, 3),
        np.repeat(normals, 3, axis=0),
        rng.uniform(0, 1, (3 * faces, 2)),
        np.arange(3 * faces).reshape(-1, 3),
        rng.integers(0, 2, faces),
        materials,
        colors=rng.uniform(0.5, 1.0, (3 * faces, 4)),
    )


def linear_from_srgb(c):
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(c):
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * np.maximum(c, 1e-12) ** (1 / 2.4) - 0.055)


def sampled(image: Texture, uv) -> np.ndarray:
    """Bilinear, repeating, colour in linear light; colour under alpha 0 must not matter."""
    pixels = image.pixels / 255.0
    rgba = np.concatenate([linear_from_srgb(pixels[..., :3]), pixels[..., 3:]], axis=-1)
    height, width = rgba.shape[:2]
    x, y = uv[0] * width - 0.5, uv[1] * height - 0.5
    x0, y0 = int(np.floor(x)), int(np.floor(y))
    fx, fy = x - x0, y - y0
    corners = [
        (rgba[(y0 + dy) % height, (x0 + dx) % width], wx * wy)
        for dy, wy in ((0, 1 - fy), (1, fy))
        for dx, wx in ((0, 1 - fx), (1, fx))
    ]
    return sum(c * w for c, w in corners)


def picture(plant: Plant, faces, board: Billboards, index: int, size, samples: int, side=1):
    """One billboard's picture, sample by sample: colour (h, w, 4) and normal (h, w, 3) in 0..1,
    depth (h, w) in -1..1; colour sRGB and straight."""
    w, h = size
    u, v = board.u[index], board.v[index]
    frame = np.stack([u, v, np.cross(u, v)])
    color = np.zeros((h, w, 3))
    normal = np.zeros((h, w, 3))
    depth = np.zeros((h, w))
    count = np.zeros((h, w))
    scale = np.append(board.half_size[index], max(board.half_depth[index], 1e-12))
    local = (plant.positions - board.center[index]) @ frame.T / scale
    for j in range(h * samples):
        for i in range(w * samples):
            at = np.array([2 * (i + 0.5) / (w * samples) - 1, 1 - 2 * (j + 0.5) / (h * samples)])
            best = None
            for f in faces:
                a, b, c = plant.faces[f]
                edges = np.stack([local[b, :2] - local[a, :2], local[c, :2] - local[a, :2]], axis=1)
                area = np.linalg.det(edges)
                material = plant.materials[plant.face_material[f]]
                facing = area * side > 0
                if area == 0 or not (facing or material.double_sided):
                    continue
                s, t = np.linalg.solve(edges, at - local[a, :2])
                if s < 0 or t < 0 or s + t > 1:
                    continue
                weight = np.array([1 - s - t, s, t])
                z = float(weight @ local[plant.faces[f], 2])
                if best is not None and z * side <= best[0]:
                    continue
                texel = sampled(material.color_texture, weight @ plant.uvs[plant.faces[f]])
                texel = texel * material.base_color
                if plant.colors is not None:
                    texel = texel * (weight @ plant.colors[plant.faces[f]])
                if material.alpha_mode == "mask" and texel[3] < material.alpha_cutoff:
                    continue
                n = frame @ (weight @ plant.normals[plant.faces[f]]) * [1, 1, side]
                n = n / np.linalg.norm(n) * (1 if facing else -1)
                best = (z * side, texel[:3], n, z)
            if best is not None:
                texel = j // samples, i // samples
                color[texel] += best[1]
                normal[texel] += best[2]
                depth[texel] += best[3]
                count[texel] += 1
    some = np.maximum(count, 1)
    length = np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    rgba = np.concatenate(
        [srgb_from_linear(color / some[..., None]), (count / samples**2)[..., None]], axis=-1
    )
    return rgba, normal / length * 0.5 + 0.5, depth / some
