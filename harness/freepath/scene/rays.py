"""Rays of cameras, random chords, single rays and rays from files."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from freepath.errors import FreepathError
from freepath.scene.media.base import Array, Medium
from freepath.scene.randomness import uniforms
from freepath.scene.ray_files import read_rays
from freepath.scene.volumes.files import find_file

CHORDS = 1  # the purpose of the random numbers, see `uniforms`

Rays = tuple[Array, Array]


def make_rays(
    model: Any, medium: Medium, seed: int, search_path: Iterable[str | Path] = ()
) -> Rays:
    """Return origins and directions (N, 3) in the world, float64, the directions of length 1.

    `model` is one of the config's models of rays. A relative `path` of rays from a file is looked
    for as volumes are, see `find_file`. Raises FreepathError for a direction of length 0, and
    VolumeError for a file that cannot be used.
    """
    if model.kind == "file":
        origins, directions = read_rays(find_file(model.path, search_path))
    else:
        origins, directions = _KINDS[model.kind](model, medium, seed)
    origins = np.ascontiguousarray(origins, dtype=np.float64)
    return origins, normalised(directions, model.kind)


def normalised(vectors: Array, what: str) -> Array:
    """Return vectors (N, 3) scaled to length 1, also denormal ones; refuse those of length 0."""
    vectors = np.asarray(vectors, dtype=np.float64)
    largest = np.abs(vectors).max(axis=1, keepdims=True)
    if not np.all(np.isfinite(largest) & (largest > 0.0)):
        raise FreepathError(f"{what}: a direction must be finite and longer than 0")
    vectors = vectors / largest  # else the squares of small components underflow
    return vectors / np.sqrt(np.sum(vectors**2, axis=1, keepdims=True))


def _frame(forward: Array) -> tuple[Array, Array]:
    """Return the directions right and up of a view along `forward`; z is up, or y along z."""
    upright = np.abs(forward[:2]).max() < 1e-6
    right = np.cross(forward, [0.0, 1.0, 0.0] if upright else [0.0, 0.0, 1.0])
    right = right / np.sqrt(np.sum(right**2))
    return right, np.cross(right, forward)


def _pixels(resolution: tuple[int, int]) -> tuple[Array, Array]:
    """Return the pixels' centres, from left to right and then from top to bottom, in (0, 1)."""
    width, height = resolution
    across = (np.arange(width) + 0.5) / width
    upward = 1.0 - (np.arange(height) + 0.5) / height
    return np.tile(across, height), np.repeat(upward, width)


def _orthographic(model: Any, medium: Medium, seed: int) -> Rays:
    """Frame the projection of the box; the rays start outside it."""
    forward = normalised([model.direction], "orthographic")[0]
    corners = medium.world_box()
    along = corners @ forward
    plane = along.min() - 0.1 * (along.max() - along.min())
    origins = plane * forward
    for axis, share in zip(_frame(forward), _pixels(model.resolution), strict=True):
        reach = corners @ axis
        place = reach.min() + share * (reach.max() - reach.min())
        origins = origins + place[:, None] * axis
    return origins, np.broadcast_to(forward, origins.shape)


def _perspective(model: Any, medium: Medium, seed: int) -> Rays:
    """Look from a point at another, with a vertical field of view in degrees."""
    position = np.asarray(model.position, dtype=np.float64)
    forward = normalised([np.asarray(model.look_at) - position], "perspective")[0]
    right, up = _frame(forward)
    width, height = model.resolution
    half_height = np.tan(np.radians(model.field_of_view) / 2.0)
    across, upward = _pixels(model.resolution)
    x = (2.0 * across - 1.0) * half_height * width / height
    y = (2.0 * upward - 1.0) * half_height
    directions = forward + x[:, None] * right + y[:, None] * up
    return np.broadcast_to(position, directions.shape), directions


def _chords(model: Any, medium: Medium, seed: int) -> Rays:
    """Draw mu-random chords: uniform on the surface, cosine-weighted inward.

    These are the paths of an isotropic and uniform flow through the box: their mean length is
    4 V / S (Coleman 1969, Random paths through convex bodies).
    """
    draws = uniforms(seed, CHORDS, (model.count, 5)).T
    corners = medium.world_box()
    edges = corners[[1, 2, 4]] - corners[0]
    normals = np.cross(edges[[1, 2, 0]], edges[[2, 0, 1]])
    areas = np.sqrt(np.sum(normals**2, axis=1))
    # inward from the faces through the first corner, whatever the handedness of the transform
    normals *= (np.sign(np.sum(normals * edges, axis=1)) / areas)[:, None]
    share = np.repeat(areas, 2)
    face = np.searchsorted(np.cumsum(share / share.sum())[:-1], draws[0], side="right")
    axis, opposite = face // 2, face % 2
    one, two = edges[(axis + 1) % 3], edges[(axis + 2) % 3]
    origins = corners[0] + opposite[:, None] * edges[axis]
    origins = origins + draws[1][:, None] * one + draws[2][:, None] * two
    normal = np.where(opposite == 1, -1.0, 1.0)[:, None] * normals[axis]
    tangent = normalised(one, "chords")
    sine, angle = np.sqrt(draws[3]), 2.0 * np.pi * draws[4]
    directions = np.sqrt(1.0 - draws[3])[:, None] * normal
    directions += (sine * np.cos(angle))[:, None] * tangent
    directions += (sine * np.sin(angle))[:, None] * np.cross(normal, tangent)
    return origins, directions


def _single(model: Any, medium: Medium, seed: int) -> Rays:
    return np.array([model.origin]), np.array([model.direction])


_KINDS: dict[str, Callable[[Any, Medium, int], Rays]] = {
    "orthographic": _orthographic,
    "perspective": _perspective,
    "chords": _chords,
    "single": _single,
}
