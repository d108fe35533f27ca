"""Paths that scatter: furnaces, emission, the rod model, mean lengths, lights, phase functions."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from scipy import stats

from freepath.checks.identities import check_clean, check_mean
from freepath.checks.parts import Lanes
from freepath.checks.rig import Flight, Rig
from freepath.checks.suite.channels import check_any
from freepath.checks.suite.common import SHEARED, Checks
from freepath.checks.verdict import demand, require
from freepath.compose import kernel_files
from freepath.compose.light_paths import SKY_COLUMNS, SKY_ROWS
from freepath.errors import imported
from freepath.measure.stats import Moments

GROUP = "scattering"
CLOUD = {"resolution": 16, "interpolation": "trilinear"}
POINT = {"point": {"position": [0.3, 0.4, 2.0], "intensity": 10}}
FEW = {"orthographic": {"resolution": 4}}
SIZE = [1.0, 1.5, 0.75]
PHASES = {"backward": -0.9, "isotropic": 0.0, "forward": 0.9}
PLACES = {
    "outside": [0.3, 0.4, 2.0],
    "inside": [0.5, 0.6, 0.4],
    "at-1e6": [0.5, 0.5, -1e6],
    "above-by-1e-6": [0.45, 0.5, 1 + 1e-6],
    "beside-by-1e-6": [0.5 + 1e-6, 0.5, 1.2],
}
"""Of a light: where rays go up in a unit cube, two of them on the line of one or beside it."""
NEAR: dict[str, dict[str, Any]] = {
    "equiangular": {"equiangular": {}},
    "tabulated": {"tabulated": {"table": "transmittance"}},
    "tabulated-product": {"tabulated": {"table": "product", "bins": 8}},
    "combined": {"combined": {"share": 0.3}},
}
NEAR_TRACKERS = ("equiangular", "tabulated", "joint", "combined")
SHADOWS = (
    ("delta", "ratio"), ("delta", "next_flight_ratio"), ("analytic", "regular"),
    ("regular", "delta"), ("weighted_delta", "track_length"), ("decomposition", "residual_ratio"),
    ("resampled", "resampled"), ("hybrid", "hybrid"),
)  # fmt: skip
SHARING = (
    ("delta", "ratio"), ("weighted_delta", "next_flight_ratio"), ("two_knob", "next_flight_delta"),
    ("delta", "delta"), ("delta", "split"), ("spectral", "spectral_ratio"),
)  # fmt: skip
"""Pairs of which lanes on paths and on shadow rays share a lookup, where there is one to share."""
EMITTED = ("delta", "analytic", "regular", "weighted_delta", "two_knob", "spectral", "resampled")
TOGETHER = (("regular", "regular"), ("weighted_delta", "ratio"))
SHAPES = {"rayleigh": (0.0, 1.0), "cornette_shanks": (0.6, 1.0), "draine": (-0.9, 20.0)}
"""Phase functions that are 1 + alpha cosine^2 times a lobe of g: g and alpha."""
ANISOTROPIES = {"0.999": 0.999, "-0.999": -0.999, "1e-7": 1e-7, "-1e-9": -1e-9, "0.3": 0.3}
GRAIN = 2.0**-23
checks = Checks()


def follow(rig: Rig, tracker: Any, medium: Any, **axes: Any) -> Flight:
    """A flight of paths that collect radiance, in 16 lanes and mostly without a record."""
    given = {"estimand": "radiance", "medium": medium, "tracker": tracker, "lanes": 16} | axes
    return rig.flight(**{"record": False} | given)


def homogeneous(sigma_t: float = 2.0, **keys: Any) -> dict[str, Any]:
    """The medium as a config has it."""
    return {"homogeneous": {"sigma_t": sigma_t, **keys}}


def furnace(rig: Rig, alpha: float, tracker: str, kind: str, shape: Any = (), **keys: Any) -> None:
    """In a furnace without absorption every path brings the same, whatever it meets: a weight that
    drifts, a path that is lost or a direction off by a little shows at once."""
    # Every path brings the environment's radiance, but for roundings of weights.
    keys |= {"albedo": 1, **dict(shape)}
    if kind == "stretched":
        # directions are turned in the world, where voxels need not be cubes
        keys["size"] = [1, 3, 0.5]
    alike = kind == "homogeneous"
    medium = homogeneous(**keys) if alike else {"cloud": CLOUD | keys}
    majorant = "global" if alike else "grid"
    one = follow(rig, tracker, medium, majorant=majorant).run(32)
    check_clean(one, bounded=True)
    error = np.max(np.abs(one.moments.mean - 1.0))
    demand(error < 1e-5, f"mean: a furnace of 1 is off by {error:.3g}")
    variance = one.moments.variance.max()
    demand(variance < 1e-9, f"variance: a furnace of 1 has {variance:.3g}")


def emission(rig: Rig, alpha: float, tracker: str) -> None:
    """Emission counted at null collisions, or without the share that is absorbed, still looks like
    a glowing cloud; the transfer equation says how bright it is."""
    # A glowing medium that does not scatter, before a bright background.
    keys, radiance = {"emission": 3}, 0.5
    if tracker == "spectral":
        keys, radiance = {"emission": [3, 1, 0.2], "channels": [1, 0.6, 0.3]}, [0.5, 0.1, 2.0]
    light = {"uniform": {"radiance": radiance}}
    flight = follow(rig, tracker, homogeneous(1.5, **keys), light=light)
    one = flight.run(4096)
    check_clean(one, bounded=True)
    check_any(one.moments, flight.reference(), alpha)


def rod(rig: Rig, alpha: float, tracker: str, albedo: float, depth: float) -> None:
    """Roulette, albedo and the end of a path multiply: reflection and transmission of the rod model
    are known, and what is missing of 1 is absorbed."""
    # Transmission and reflection together; of emission, what is missing of a furnace.
    through, back = rod_model(albedo, depth)
    lit = homogeneous(depth, albedo=albedo, phase="rod")
    one = follow(rig, tracker, lit, rays=FEW).run(8192)
    check_mean(one.moments, np.full(16, through + back), alpha / 2)
    glowing = homogeneous(depth, albedo=albedo, phase="rod", emission=1)
    one = follow(rig, tracker, glowing, rays=FEW, light="dark").run(8192)
    check_mean(one.moments, np.full(16, 1 - through - back), alpha / 2)


def length(rig: Rig, alpha: float, tracker: str, sigma_t: float, g: float) -> None:
    """Directions that are not uniform, or paths that do not end at the boundary, change the mean
    length of paths, which is 4 V / S whatever the density."""
    # 4 V / S under isotropic uniform light (Blanco and Fournier 2003).
    size = np.array(SIZE)
    medium = homogeneous(sigma_t, albedo=1, g=g, size=SIZE)
    rays = {"chords": {"count": 8192}}
    means = follow(rig, tracker, medium, estimand="path_length", rays=rays).run(16).moments.mean
    surface = 2 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0])
    expected = 4 * size.prod() / surface
    error = means.std(ddof=1) / np.sqrt(len(means))
    demand(error < 0.02 * means.mean(), f"mean length: known to {error / means.mean():.2g} only")
    p_value = 2 * stats.norm.sf(abs(means.mean() - expected) / error)
    found = np.array([means.mean()])
    require(np.array([p_value]), alpha, "mean length", found, np.array([expected]))


def single(rig: Rig, alpha: float, tracker: str, shadow: str, g: float) -> None:
    """A phase function, a distance squared or a shadow ray that is off by a factor is no more than
    another light; single scattering has an integral."""
    # A point light outside of a homogeneous medium, which is sheared where g is not 0.
    medium, axes = homogeneous(albedo=0.5, g=g), {"scatterings": 1, "shadow": shadow}
    turned = SHEARED if g else None
    flight = follow(rig, tracker, medium, light=POINT, turned=turned, **axes)
    one = flight.run(8192)
    check_clean(one, bounded=True)
    check_mean(one.moments, flight.reference(), alpha)


def voxels(rig: Rig, alpha: float, tracker: str, shadow: str, g: float) -> None:
    """Lanes on paths and on shadow rays that share a lookup must not take over each other's
    weights; in voxels that are all alike the integral is that of a homogeneous medium."""
    # A point light outside of voxels that are all alike.
    optics = {"sigma_t": 2.0, "albedo": 0.5, "g": g}
    axes = {"light": POINT, "scatterings": 1, "shadow": shadow, "tightness": 1.5}
    medium = rig.volume(np.ones((4, 4, 4)), voxel_size=0.25, **optics)
    one = follow(rig, tracker, medium, majorant="grid", **axes).run(8192)
    check_clean(one, bounded=True)
    check_mean(one.moments, follow(rig, tracker, homogeneous(**optics), **axes).reference(), alpha)


def light(
    rig: Rig, alpha: float, tracker: str, sampler: dict[str, Any], place: str, g: float = 0.3
) -> None:
    """Distances that are drawn for a light lose their digits beside it, far away from it and on its
    line; the mean must stay that of the integral."""
    # A sampler of light, with the light outside, inside, far away, or close to a ray.
    position = PLACES[place]
    distance = max(1.0, abs(position[2]))
    lamp = {"point": {"position": position, "intensity": 10 * distance**2}}
    axes = {"light": lamp, "scatterings": 1, "shadow": "ratio"}
    axes["rays"] = {"orthographic": {"resolution": 9}}
    turned = SHEARED if place == "outside" else None
    # with a record, as the kernel of their moments
    flight = follow(rig, sampler, homogeneous(albedo=0.5, g=g), turned=turned, record=True, **axes)
    one, expected = flight.run(8192), flight.reference()
    check_clean(one, bounded=True)
    known = np.isfinite(expected)
    demand(known.sum() >= 72, f"only {known.sum()} of 81 rays have a finite reference")
    moments = Moments(one.moments.count, one.moments.mean[known], one.moments.m2[known])
    check_mean(moments, expected[known], alpha)


def sky(rig: Rig, alpha: float) -> None:
    """One bright pixel at an odd place or beside a pole is lost or seen twice where rows, columns
    or channels are mixed up, and no furnace tells."""
    # Of each pixel of a table of three colours what stands there, through nothing.
    oiio, path = imported("OpenImageIO", "a sky"), rig.folder / "sky.exr"
    rows, columns = SKY_ROWS, SKY_COLUMNS
    pixels = np.random.default_rng(7).random((rows, columns, 3))
    pixels[rows // 3, columns - 5, 1] = pixels[0, 11, 2] = pixels[-1, columns // 2 + 3, 0] = 1e4
    image = oiio.ImageBuf(np.ascontiguousarray(pixels, np.float32))
    demand(image.write(str(path)), f"{path} cannot be written: {image.geterror()}")
    row, column = (place.ravel() for place in np.indices((rows, columns)))
    down, around = (row + 0.5) / rows * np.pi, (0.5 - (column + 0.5) / columns) * 2.0 * np.pi
    flat = np.sin(down)
    ahead = np.column_stack([flat * np.cos(around), flat * np.sin(around), np.cos(down)])
    lines, light = (np.full((row.size, 3), 0.5), ahead), {"image": {"file": str(path)}}
    medium = homogeneous(0.0, channels=[1, 0.6, 0.3])
    one = follow(rig, "spectral", medium, light=light, lines=lines, turned=SHEARED).run(1)
    error = np.abs(one.moments.mean - pixels.reshape(-1, 3)).max()
    # a direction is rounded to 1e-6 of a row or a column, of which one may be that bright
    demand(error < 0.5, f"a pixel of the sky is off by {error:.3g}")


def several(rig: Rig, alpha: float, tracker: str, shadow: str) -> None:
    """Beyond one scattering there is no reference: trackers are held against each other."""
    # A cloud that scatters more than once, against delta tracking.
    near = tracker in NEAR_TRACKERS
    # weights of a sampler of light multiply: after eight scatterings only their tail counts
    medium = {"cloud": CLOUD | {"sigma_t": 3 if near else 10, "albedo": 0.9, "g": 0.4}}
    axes = {"light": POINT, "scatterings": 2 if near else 8, "majorant": "grid"}
    one = follow(rig, tracker, medium, shadow=shadow, **axes).run(4096)
    other = follow(rig, "delta", medium, shadow="ratio", **axes).run(4096, first_sample=10000)
    check_clean(one, bounded=True)
    joint = Moments(4096, one.moments.mean, one.moments.m2 + other.moments.m2)
    check_mean(joint, other.moments.mean, alpha)


def phase_function(
    rig: Rig, alpha: float, g: float, kind: str = "henyey_greenstein", squared: float = 0.0
) -> None:
    """A phase function that is not sampled as it is evaluated brings light that is not there; near
    0 and 1 its closed form divides 0 by 0."""
    # Cosines as they are drawn against the cumulated density, and the density against its form.
    files = (*(("math/newton", "light/squared_cosine") if squared else ()), f"light/phase_{kind}")
    code = "\n".join(kernel_files.read(name).code for name in files)
    code = code.replace("scene->optics.g", f"((SCALAR){g!r})")
    code = code.replace("scene->optics.alpha", f"((SCALAR){squared!r})")
    lanes = Lanes(rig, 16, more=f"#define ROUNDING 1.1920929e-7f\ntypedef int Scene;\n{code}")
    count, draws = 4096, 64
    body = "if (n == 0) rng = stream(seed, in0, 3ul, in1); "
    body += "const Scene *none = 0; out0 = sample_cosine(none, &rng); out1 = phase(none, out0);"
    ray = np.arange(count)
    drawn = lanes(body, [ray, ray % 3], ["real", "real"], count, draws)
    cosine, density = (values.astype(np.float64) for values in drawn)
    g = float(np.float32(g))
    demand(np.abs(cosine).max() <= 1.0, "a cosine beyond 1")
    demand(np.isfinite(density).all() and density.min() > 0.0, "a density that is no number")
    ordered = np.sort(cosine.ravel())
    rank = np.arange(ordered.size + 1) / ordered.size
    # a cosine is rounded, which is much of the lobe of a g near 1
    below = _cumulated(g, np.maximum(ordered - GRAIN, -1.0), squared) - rank[:-1]
    above = rank[1:] - _cumulated(g, np.minimum(ordered + GRAIN, 1.0), squared)
    distance = max(below.max(), above.max(), 0.0)
    require(np.array([stats.kstwo.sf(distance, ordered.size)]), alpha, "cosines (KS)")
    error = np.max(np.abs(density / _density(g, cosine, squared) - 1.0))
    demand(error < 1e-3, f"the density is off by {error:.3g}")


def _density(g: float, cosine: np.ndarray, squared: float) -> np.ndarray:
    lobe = (1.0 - g * g) / (4.0 * np.pi * ((1.0 - g) ** 2 + 2.0 * g * (1.0 - cosine)) ** 1.5)
    return lobe * (1.0 + squared * cosine**2) / (1.0 + squared * (1.0 + 2.0 * g * g) / 3.0)


def _cumulated(g: float, cosine: np.ndarray, squared: float) -> np.ndarray:
    """The chance of a smaller cosine."""
    if squared:
        at = np.linspace(-1.0, 1.0, 100_001)
        both = _density(g, at[1:], squared) + _density(g, at[:-1], squared)
        return np.interp(cosine, at, np.append(0.0, np.cumsum(np.pi * both * np.diff(at))))
    if abs(g) < 1e-3:
        return (1.0 + cosine) / 2.0 - 0.75 * g * (1.0 - cosine**2)
    root = 1.0 / np.sqrt((1.0 - g) ** 2 + 2.0 * g * (1.0 - cosine))
    return np.clip((1.0 - g * g) / (2.0 * g) * (root - 1.0 / (1.0 + g)), 0.0, 1.0)


def rod_model(albedo: float, depth: float) -> tuple[float, float]:
    """What a slab transmits and reflects where light goes on or back with equal chances."""
    k = np.sqrt(1 - albedo)
    r = (1 - k) / (1 + k)
    damped = 1 - r**2 * np.exp(-2 * k * depth)
    return (1 - r**2) * np.exp(-k * depth) / damped, r * (1 - np.exp(-2 * k * depth)) / damped


def _one(name: str, tracker: str, situation: Any, **options: Any) -> None:
    checks.one(f"{GROUP}/{name}", tracker, **options)(situation)


for (phase, g), depth in itertools.product(PHASES.items(), (1, 10, 100)):
    for kind in ("homogeneous", "grid"):
        name, keys = f"furnace/{kind}-tau-{depth}-{phase}/delta", {"sigma_t": depth, "g": g}
        _one(name, "delta", furnace, kind=kind, **keys)
shape = {"phase": "draine", "g": -0.9, "alpha": 20}
_one("furnace/draine/regular", "regular", furnace, kind="grid", shape=shape, sigma_t=10)
for kind in ("grid", "stretched"):
    _one(f"furnace/{kind}/regular", "regular", furnace, kind=kind, sigma_t=30, g=0.9)
for tracker, shadow in (*TOGETHER, *((name, "ratio") for name in NEAR_TRACKERS)):
    _one(f"several/{shadow}/{tracker}", tracker, several, shadow=shadow)
for tracker in EMITTED:
    _one(f"emission/{tracker}", tracker, emission)
for albedo, depth in itertools.product((0.3, 0.9), (0.5, 2.0, 8.0)):
    keys = {"albedo": albedo, "depth": depth}
    _one(f"rod/albedo-{albedo}-tau-{depth}/delta", "delta", rod, **keys)
for sigma_t, g in itertools.product((0.1, 3.0, 30.0), (0.0, 0.7)):
    _one(f"length/tau-{sigma_t}-g-{g}/delta", "delta", length, sigma_t=sigma_t, g=g)
_one("length/tau-3.0-g-0.7/march", "march", length, sigma_t=3.0, g=0.7)
for kind, pairs in ((single, SHADOWS), (voxels, SHARING)):
    for turn, (tracker, shadow) in enumerate((*pairs, *pairs)):
        g = 0.0 if turn < len(pairs) else (0.6, -0.7)[turn % 2]
        name = f"{kind.__name__}/{shadow}-g-{g}/{tracker}"
        _one(name, tracker, kind, shadow=shadow, g=g)
for (name, sampler), place in itertools.product(NEAR.items(), PLACES):
    (tracker,) = sampler
    full = f"light/{place}/{name}" if name == tracker else f"light/{place}/{name}/{tracker}"
    _one(full, tracker, light, sampler=sampler, place=place)
_one("sky/spectral", "", sky)
for name, g in ANISOTROPIES.items():
    _one(f"phase/g-{name}", "", phase_function, g=g)
for kind, (g, squared) in SHAPES.items():
    _one(f"phase/{kind}", "", phase_function, g=g, kind=kind, squared=squared)
