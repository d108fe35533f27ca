"""What scatters twice in a homogeneous box, from a point light: quasi-Monte Carlo in float64."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from freepath.scene.lights.radiance import henyey_greenstein

Array = NDArray[np.float64]
REPLICAS = 8


def double_scattering(
    sigma_t: float, g: float, position: Array, segments: Array, *, seed: int, points: int = 2**14
) -> tuple[Array, Array]:
    """Return the light of a point of unit intensity that scatters twice, and its standard error.

    Per ray of `segments` (N, 7) in a unit cube, for an albedo of 1 and lengths of the world. The
    variables are those of Georgiev et al. 2013, in which the integrand is free of the distances
    to the light and between the vertices (docs/light.md); the points are Sobol's, scrambled
    REPLICAS times, which gives the error.
    """
    means = [
        _mean(sigma_t, g, position, segments, qmc.Sobol(4, seed=seed + one).random(points))
        for one in range(REPLICAS)
    ]
    return np.mean(means, axis=0), np.std(means, axis=0, ddof=1) / np.sqrt(REPLICAS)


def _mean(sigma_t: float, g: float, position: Array, segments: Array, u: Array) -> Array:
    return np.array([_of_ray(sigma_t, g, position, ray, u) for ray in segments])


def _of_ray(sigma_t: float, g: float, position: Array, ray: Array, u: Array) -> float:
    origin, ahead, length = ray[:3], ray[3:6], ray[6]
    nearest = (position - origin) @ ahead
    off = np.linalg.norm(position - origin - nearest * ahead)
    low, high = np.arcsinh(-nearest / off), np.arcsinh((length - nearest) / off)
    t = np.clip(nearest + off * np.sinh(low + (high - low) * u[:, 0]), 0.0, length)
    first = origin + t[:, None] * ahead
    to_light, distance = _way(first, position)
    theta = np.pi * u[:, 1]
    across = np.cross(to_light, _least_axis(to_light))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    other = np.cross(to_light, across)
    phi = 2 * np.pi * u[:, 2:3]
    turned = np.cos(theta)[:, None] * to_light
    turned += np.sin(theta)[:, None] * (np.cos(phi) * across + np.sin(phi) * other)
    beside, passing = distance * np.sin(theta), distance * np.cos(theta)
    end = np.arctan2(_way_out(first, turned) - passing, beside)
    start = np.arctan2(-passing, beside)
    way = passing + beside * np.tan(start + (end - start) * u[:, 3])
    second = first + way[:, None] * turned
    towards, last = _way(second, position)
    depth = sigma_t * (t + way + np.minimum(last, _way_out(second, towards)))
    value = sigma_t**2 * np.exp(-depth)
    value *= henyey_greenstein(g, turned @ ahead)
    value *= henyey_greenstein(g, np.sum(towards * turned, axis=1))
    # theta is uniform here: d omega dt dr / last^2 = D / off' x du, and so on, but for constants
    return float(np.mean(value * 2 * np.pi**2 * (high - low) * (end - start)))


def _way(points: Array, position: Array) -> tuple[Array, Array]:
    gap = position - points
    distance = np.linalg.norm(gap, axis=1)
    return gap / distance[:, None], distance


def _least_axis(directions: Array) -> Array:
    """The axis of which each direction has least."""
    return np.eye(3)[np.argmin(np.abs(directions), axis=1)]


def _way_out(points: Array, directions: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        way = (np.where(directions > 0, 1.0, 0.0) - points) / directions
    return np.maximum(np.where(directions == 0, np.inf, way).min(axis=1), 0.0)
