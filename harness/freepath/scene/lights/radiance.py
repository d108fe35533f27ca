"""What paths that scatter should collect, in float64, where that has a closed form."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from freepath.scene.lights.sky import Sky
from freepath.scene.media.base import Array, Medium
from freepath.scene.media.scaled import Scaled
from freepath.scene.references import reference

POINTS = 400
"""Of the Gauss-Legendre rule along a ray, in the angle that the light sees it under."""


def path_reference(
    case: Any, medium: Medium, segments: Array, sky: Sky | None = None
) -> Array | None:
    """Return what a case of radiance or path_length should give for segments (N, 7).

    As (N,) or (N, channels) float64; None where there is no closed form. There is one where nothing
    scatters, where nothing is absorbed in a uniform environment, and for single scattering of a
    point light's in a homogeneous medium. `sky` is the image that lights the case.
    """
    outside = None if sky is None else sky.radiance(_directions(medium, segments))
    each = [
        _of_channel(case, Scaled(medium, factor), segments, channel, outside)
        for channel, factor in enumerate(medium.channels)
    ]
    if any(one is None for one in each):
        return None
    return each[0] if len(each) == 1 else np.stack(each, axis=1)


def _directions(medium: Medium, segments: Array) -> Array:
    """Return the directions of segments (N, 7) in the world, (N, 3)."""
    return segments[:, 3:6] @ np.linalg.inv(medium.to_medium[:, :3]).T


def _of_channel(
    case: Any, medium: Medium, segments: Array, channel: int, outside: Array | None
) -> Array | None:
    albedo = _value(case.medium.albedo, channel)
    emission = _value(case.medium.emission, channel)
    radiance = _value(getattr(case.light, "radiance", (0.0,)), channel)
    intensity = _value(getattr(case.light, "intensity", (0.0,)), channel)
    if case.estimand == "path_length":
        ends_at_once = albedo == 0 or case.scatterings == 0
        return reference("free_path", medium, segments) if ends_at_once else None
    if albedo == 0 or case.scatterings == 0:
        through = reference("transmittance", medium, segments)
        seen = radiance if outside is None else outside[:, channel]
        return (1 - albedo) * emission * (1 - through) + seen * through
    same = outside is None
    if same and emission == radiance == intensity == 0:
        return np.zeros(len(segments))
    if same and albedo == 1 and case.scatterings == "unlimited" and intensity == 0:
        return np.full(len(segments), radiance)
    single = same and case.scatterings == 1 and medium.kernel == "homogeneous"
    if single and emission == 0 and radiance == 0 and case.medium.phase == "henyey_greenstein":
        return albedo * intensity * _single_scattering(case, medium, segments)
    return None


def _value(values: tuple[float, ...], channel: int) -> float:
    return values[channel] if len(values) > 1 else values[0]


def _single_scattering(case: Any, medium: Medium, segments: Array) -> Array:
    """Return the light of a point of unit intensity that scatters once, (N,).

    The integral of sigma T(0, t) phase T(t, light) / distance^2 over t, in the variable theta =
    atan((t - t_nearest) / distance_nearest), in which the geometry term is constant (Kulla and
    Fajardo 2012, eq. 5).
    """
    sigma = medium.sigma_t(np.zeros((1, 3)))[0]
    to_world = np.linalg.inv(medium.to_medium[:, :3])
    origins = (segments[:, :3] - medium.to_medium[:, 3]) @ to_world.T
    ahead = segments[:, 3:6] @ to_world.T
    to_light = np.array(case.light.position) - origins
    nearest = (to_light * ahead).sum(axis=1)
    off = np.linalg.norm(to_light - nearest[:, None] * ahead, axis=1)
    # a light on the line of a ray but not on the ray: from beside, by what no integral can tell
    off = np.maximum(off, 1e-7 * np.abs(nearest))
    low, high = np.arctan2(-nearest, off), np.arctan2(segments[:, 6] - nearest, off)
    nodes, weights = _rule()
    result = np.zeros(len(segments))
    for node, weight in zip(nodes, weights, strict=True):
        theta = low + (high - low) * (node + 1) / 2
        t = nearest + off * np.tan(theta)
        gap = to_light - t[:, None] * ahead
        distance = np.linalg.norm(gap, axis=1)
        towards = gap / distance[:, None]
        cosine = (towards * ahead).sum(axis=1)
        points = segments[:, :3] + t[:, None] * segments[:, 3:6]
        inside = _way_out(points, towards @ medium.to_medium[:, :3].T, medium.extent)
        depth = sigma * (t + np.minimum(inside, distance))
        value = sigma * np.exp(-depth) * henyey_greenstein(case.medium.g, cosine)
        result += weight / 2 * (high - low) / off * value
    return result


@functools.cache
def _rule() -> tuple[Array, Array]:
    """The Gauss-Legendre rule, which is more expensive to set up than to use."""
    return np.polynomial.legendre.leggauss(POINTS)


def _way_out(points: Array, direction: Array, extent: Array) -> Array:
    """Return the length along directions (N, 3) from points (N, 3) to the faces of the box."""
    with np.errstate(divide="ignore", invalid="ignore"):
        way = (np.where(direction > 0, extent, 0.0) - points) / direction
    return np.where(direction == 0, np.inf, way).min(axis=1)


def henyey_greenstein(g: float, cosine: Array) -> Array:
    """Return the phase function (1/sr) of the angle between directions before and after."""
    return (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)
