"""Tangent frames from texture coordinates."""

from __future__ import annotations

import numpy as np
import pytest
from written import upright_square

from vegtool.tangents import tangents

FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
UP = np.tile([0.0, 0.0, 1.0], (4, 1))


def frame_axes(frames: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tangent and bitangent as glTF defines them: directions of the picture's right and top."""
    return frames[:, :3], np.cross(normals, frames[:, :3]) * frames[:, 3:]


def test_an_upright_picture_has_its_right_along_x_and_its_top_along_y():
    corners, uvs = upright_square()
    frames, origin, faces = tangents(corners, UP, uvs, FACES)
    assert frames.tolist() == [[1, 0, 0, 1]] * 4
    assert origin.tolist() == [0, 1, 2, 3]
    assert np.array_equal(faces, FACES)


def test_a_mirrored_picture_has_its_right_against_x_and_its_top_along_y():
    corners, uvs = upright_square()
    frames, _, _ = tangents(corners, UP, uvs * [-1, 1] + [1, 0], FACES)
    assert frames.tolist() == [[-1, 0, 0, -1]] * 4


def test_normals_against_the_winding_turn_the_sign_and_not_the_picture():
    corners, uvs = upright_square()
    frames, _, _ = tangents(corners, -UP, uvs, FACES)
    right, top = frame_axes(frames, -UP)
    assert right.tolist() == [[1, 0, 0]] * 4
    assert top.tolist() == [[0, 1, 0]] * 4


def test_vertices_on_a_mirror_seam_are_split():
    # Two squares side by side; the right one shows the left one's picture mirrored at x = 1.
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]], float)
    uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0], [0, 1], [0, 0]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]], np.int32)
    frames, origin, split = tangents(corners, np.tile([0.0, 0.0, 1.0], (6, 1)), uvs, faces)
    assert origin.tolist() == [0, 1, 2, 3, 4, 5, 1, 2]
    assert np.array_equal(origin[split], faces)
    assert set(split[:2].ravel()).isdisjoint(split[2:].ravel())
    assert np.array_equal(frames[split[:2]], np.broadcast_to([1.0, 0, 0, 1], (2, 3, 4)))
    assert np.array_equal(frames[split[2:]], np.broadcast_to([-1.0, 0, 0, -1], (2, 3, 4)))


def random_mesh(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(40, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    faces = rng.permuted(np.tile(np.arange(40), (60, 1)), axis=1)[:, :3].astype(np.int32)
    return rng.random((40, 3)), normals, rng.random((40, 2)), faces


@pytest.mark.parametrize("seed", range(3))
def test_frames_equal_a_plain_sum_over_the_faces_at_each_vertex(seed):
    positions, normals, uvs, faces = random_mesh(seed)
    frames, origin, split = tangents(positions, normals, uvs, faces)
    assert np.array_equal(origin[split], faces)
    for vertex in np.unique(split):
        right, down = np.zeros(3), np.zeros(3)
        for corners in split[(split == vertex).any(axis=1)]:
            # Solve (e1, e2) = (right, down) @ (uv differences) for the picture's axes in space.
            p, t = positions[origin[corners]], uvs[origin[corners]]
            axes = np.linalg.solve(t[1:] - t[0], p[1:] - p[0])
            right += axes[0] / np.linalg.norm(axes[0])
            down += axes[1] / np.linalg.norm(axes[1])
        n = normals[origin[vertex]]
        flat = right - n * (n @ right)
        assert np.allclose(frames[vertex, :3], flat / np.linalg.norm(flat), atol=1e-9)
        assert frames[vertex, 3] == (1 if np.cross(n, frames[vertex, :3]) @ -down >= 0 else -1)


def test_every_frame_is_orthonormal_even_without_texture_coordinates():
    positions, normals, _, faces = random_mesh(0)
    frames, origin, _ = tangents(positions, normals, np.zeros((40, 2)), faces)
    assert np.allclose(np.linalg.norm(frames[:, :3], axis=1), 1)
    assert np.allclose(np.einsum("ij,ij->i", frames[:, :3], normals[origin]), 0, atol=1e-12)
    assert set(frames[:, 3]) <= {1.0, -1.0}


def test_scale_and_shift_of_the_mesh_change_nothing():
    positions, normals, uvs, faces = random_mesh(1)
    here, _, _ = tangents(positions, normals, uvs, faces)
    there, _, _ = tangents(positions * 1e-3 + 5, normals, uvs, faces)
    assert np.allclose(here, there, atol=1e-8)
