"""Paths that scatter: furnaces, emission, rod model, mean lengths, a point light, defects."""

import numpy as np
import pytest
from freepath.check.identities import check_clean, check_mean
from freepath.check.rig import Change
from freepath.check.verdict import require, sidak
from freepath.stats import Moments
from scipy import stats

ALPHA = 1e-4
GRID = {"cloud": {"resolution": 16, "interpolation": "trilinear"}}
POINT = {"point": {"position": [0.3, 0.4, 2.0], "intensity": 10}}


def radiance(rig, medium, tracker="delta", **axes):
    return rig.flight(
        **{"estimand": "radiance", "medium": medium, "tracker": tracker, "lanes": 16} | axes
    )


def homogeneous(sigma_t=2.0, **keys):
    return {"homogeneous": {"sigma_t": sigma_t, **keys}}


def check_furnace(one, expected=1.0):
    """Every path returns the environment, up to roundings of a direction and a weight."""
    np.testing.assert_allclose(one.moments.mean, expected, rtol=1e-5)
    assert one.moments.variance.max() < 1e-9


@pytest.mark.parametrize("g", [-0.9, 0.0, 0.9])
@pytest.mark.parametrize("sigma_t", [1.0, 10.0, 100.0])
def test_white_furnace(rig, sigma_t, g):
    one = radiance(rig, homogeneous(sigma_t, albedo=1, g=g)).run(64)
    check_clean(one, bounded=True)
    check_furnace(one)


@pytest.mark.parametrize("g", [-0.9, 0.9])
@pytest.mark.parametrize("tracker", ["delta", "regular"])
def test_white_furnace_of_a_grid(rig, tracker, g):
    medium = {"cloud": GRID["cloud"] | {"sigma_t": 100, "albedo": 1, "g": g}}
    one = radiance(rig, medium, tracker, majorant="grid").run(32)
    check_clean(one, bounded=True)
    check_furnace(one)


def test_white_furnace_of_a_turned_and_stretched_grid(rig, tmp_path):
    """Directions are turned in the world, where voxels need not be cubes."""
    medium = {"cloud": GRID["cloud"] | {"sigma_t": 20, "albedo": 1, "size": [1, 3, 0.5]}}
    check_furnace(radiance(rig, medium, majorant="grid").run(32))


@pytest.mark.parametrize("tracker", ["delta", "analytic", "regular", "weighted_delta", "two_knob"])
def test_emission_and_absorption(rig, tracker):
    medium = homogeneous(1.5, emission=3)
    flight = radiance(rig, medium, tracker, light={"uniform": {"radiance": 0.5}})
    assert "scattering" not in flight.runner.program.source.text
    check_mean(flight.run(4096).moments, flight.reference(), ALPHA)


@pytest.mark.parametrize("albedo", [0.3, 0.9])
@pytest.mark.parametrize("depth", [0.5, 2.0, 8.0])
def test_rod_model(rig, albedo, depth):
    """Transmission and reflection together; of emission, what is missing of a furnace."""
    medium = homogeneous(depth, albedo=albedo, phase="rod")
    rays = {"orthographic": {"resolution": 4}}
    one = radiance(rig, medium, rays=rays).run(8192)
    k = np.sqrt(1 - albedo)
    r = (1 - k) / (1 + k)
    damped = 1 - r**2 * np.exp(-2 * k * depth)
    through = (1 - r**2) * np.exp(-k * depth) / damped
    back = r * (1 - np.exp(-2 * k * depth)) / damped
    check_mean(one.moments, np.full(16, through + back), ALPHA)
    glowing = homogeneous(depth, albedo=albedo, phase="rod", emission=1)
    one = radiance(rig, glowing, rays=rays, light="dark").run(8192)
    check_mean(one.moments, np.full(16, 1 - through - back), ALPHA)


@pytest.mark.parametrize("sigma_t", [0.1, 3.0, 30.0])
@pytest.mark.parametrize("g", [0.0, 0.7])
def test_mean_length_of_paths(rig, sigma_t, g):
    """4 V / S under isotropic uniform light, whatever the density (Blanco and Fournier 2003)."""
    size = np.array([1.0, 1.5, 0.75])
    medium = homogeneous(sigma_t, albedo=1, g=g, size=size.tolist())
    rays = {"chords": {"count": 8192}}
    one = radiance(rig, medium, estimand="path_length", rays=rays).run(16)
    surface = 2 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0])
    means = one.moments.mean
    error = means.std(ddof=1) / np.sqrt(len(means))
    z = (means.mean() - 4 * size.prod() / surface) / error
    assert error < 0.02 * means.mean()
    require(np.array([2 * stats.norm.sf(abs(z))]), ALPHA, "mean length")


@pytest.mark.parametrize(
    ("tracker", "shadow"),
    [
        ("delta", "ratio"),
        ("delta", "next_flight_ratio"),
        ("analytic", "regular"),
        ("regular", "delta"),
        ("weighted_delta", "track_length"),
        ("decomposition", "residual_ratio"),
    ],
)
@pytest.mark.parametrize("g", [0.0, 0.6])
def test_single_scattering(rig, tracker, shadow, g):
    medium = homogeneous(2.0, albedo=0.5, g=g)
    flight = radiance(rig, medium, tracker, light=POINT, scatterings=1, shadow=shadow)
    one = flight.run(8192)
    check_clean(one, bounded=True)
    check_mean(one.moments, flight.reference(), ALPHA)


@pytest.mark.parametrize(
    "tracker",
    [
        "equiangular",
        {"tabulated": {"table": "transmittance"}},
        {"tabulated": {"table": "product", "bins": 8}},
        {"combined": {"share": 0.3}},
    ],
)
@pytest.mark.parametrize(
    "position",
    [
        [0.3, 0.4, 2.0],
        [0.5, 0.6, 0.4],
        [0.5, 0.5, -1e6],
        [0.45, 0.5, 1 + 1e-6],
        [0.5 + 1e-6, 0.5, 1.2],
    ],
)
def test_samplers_of_light(rig, tracker, position):
    """Outside, inside, far away, on the ray's line and beside it by 1e-6."""
    distance = max(1.0, abs(position[2]))
    light = {"point": {"position": position, "intensity": 10 * distance**2}}
    rays = {"orthographic": {"resolution": 9}}
    axes = {"light": light, "scatterings": 1, "shadow": "ratio", "rays": rays}
    flight = radiance(rig, homogeneous(2.0, albedo=0.5, g=0.3), tracker, **axes)
    one = flight.run(8192)
    check_clean(one, bounded=True)
    expected = flight.reference()
    known = np.isfinite(expected)
    assert known.sum() >= 72
    moments = Moments(one.moments.count, one.moments.mean[known], one.moments.m2[known])
    check_mean(moments, expected[known], ALPHA)


@pytest.mark.parametrize("tracker", ["equiangular", "tabulated", "combined"])
def test_samplers_of_light_agree_with_delta_tracking_in_a_cloud(rig, tracker):
    medium = {"cloud": GRID["cloud"] | {"sigma_t": 10, "albedo": 0.9, "g": 0.2}}
    axes = {"light": POINT, "scatterings": 3, "majorant": "grid"}
    one, other = (radiance(rig, medium, name, **axes) for name in (tracker, "delta"))
    one, other = one.run(4096).moments, other.run(4096, first_sample=10000).moments
    check_mean(Moments(4096, one.mean, one.m2 + other.m2), other.mean, ALPHA)


@pytest.mark.parametrize("probability", ["history_average", "average"])
def test_channels_scatter_with_their_own_albedo(rig, probability):
    keys = {"channels": [1, 0.6, 0.3], "albedo": [0.9, 0.5, 0.0]}
    tracker = {"spectral": {"probability": probability}}
    light = {"point": {"position": [0.3, 0.4, 2.0], "intensity": [10, 5, 5]}}
    axes = {"light": light, "scatterings": 1, "shadow": "spectral_ratio"}
    flight = radiance(rig, homogeneous(2.0, **keys), tracker, **axes)
    moments, expected = flight.run(8192).moments, flight.reference()
    assert not moments.mean[:, 2].any()
    for channel in (0, 1):
        one = Moments(moments.count, moments.mean[:, channel], moments.m2[:, channel])
        check_mean(one, expected[:, channel], ALPHA)


def test_trackers_agree_on_multiple_scattering(rig):
    """Without a reference they are held against each other, all rays and groups of rays."""
    medium = {"cloud": GRID["cloud"] | {"sigma_t": 15, "albedo": 0.9, "g": 0.5}}
    axes = {"light": POINT, "scatterings": 8, "majorant": "grid"}
    trackers = [("delta", "ratio"), ("regular", "regular"), ("weighted_delta", "ratio")]
    found = [radiance(rig, medium, one, shadow=other, **axes) for one, other in trackers]
    moments = [flight.run(2048, first_sample=4096 * i).moments for i, flight in enumerate(found)]
    alpha = sidak(1e-3, 2)
    for other in moments[1:]:
        joint = Moments(2048, moments[0].mean, moments[0].m2 + other.m2)
        check_mean(joint, other.mean, alpha)


def test_everything_gives_what_the_scene_has(rig):
    """`effects: all` compiles more and returns the same, sample for sample."""
    medium = homogeneous(2.0, albedo=0.8)
    one, all_of_it = (radiance(rig, medium, effects=effects) for effects in ("auto", "all"))
    text, more = (flight.runner.program.source.text for flight in (one, all_of_it))
    assert all(name in more and name not in text for name in ("light_directly", "emit("))
    one, other = one.record(64), all_of_it.record(64)
    for scores in other.scores:
        np.testing.assert_allclose(scores, one.score, rtol=1e-4, atol=1e-5)


def test_a_sample_is_the_same_in_any_number_of_lanes(rig):
    medium = {"cloud": GRID["cloud"] | {"sigma_t": 10, "albedo": 0.9, "g": 0.3}}
    scores = [
        radiance(rig, medium, light=POINT, majorant="grid", lanes=lanes).record(64).score
        for lanes in (1, 16)
    ]
    same = np.isclose(*scores, rtol=1e-3, atol=1e-6)
    assert same.mean() > 0.999


@pytest.mark.parametrize("u", np.linspace(-1, 1, 5))
@pytest.mark.parametrize("g", [-0.999, -0.5, -1e-7, 1e-9, 0.3, 0.999])
def test_the_phase_function_is_the_density_of_its_cosine(rig, g, u):
    """Its integral up to the cosine that is sampled from u is the share of smaller u."""
    share = (u + 1) / 2
    base = 1 + g * u
    cosine = (1 + g * g - ((1 - g * g) / base) ** 2) / (2 * g) if abs(g) > 1e-3 else u
    if abs(g) > 1e-3:
        integral = (1 - g * g) / (2 * g) * ((1 + g * g - 2 * g * cosine) ** -0.5 - 1 / (1 + g))
        np.testing.assert_allclose(integral, share, atol=1e-9)


DEFECTS = {
    "a phase function that is not normalised": (
        Change("return (real)(SCALAR)0.0795", "return (real)(SCALAR)0.085"),
        {"light": POINT, "scatterings": 1},
        {"albedo": 0.5},
    ),
    "a geometry term without the square": (
        Change("/ (distance * distance);", "/ distance;"),
        {"light": POINT, "scatterings": 1},
        {"albedo": 0.5},
    ),
    "an emission collected twice": (
        Change("absorbed * scene->optics.emission[c]", "2 * absorbed * scene->optics.emission[c]"),
        {"light": "dark"},
        {"emission": 1},
    ),
    "a scattering albedo left out": (
        Change(
            "= scene->optics.albedo[c] * scene->light.intensity[c];", "= scene->light.intensity[c];"
        ),
        {"light": POINT, "scatterings": 1},
        {"albedo": 0.5},
    ),
    "a shadow ray that goes on behind the light": (
        Change("shadow.length = smaller(shadow.length, distance);", ""),
        {"light": {"point": {"position": [0.5, 0.5, 0.5], "intensity": 1}}, "scatterings": 1},
        {"albedo": 0.5},
    ),
    "a ray that its next path does not start on": (
        Change("    restore_ray(path, ended);", ""),
        {"light": POINT, "scatterings": 1},
        {"albedo": 0.5},
    ),
}


@pytest.mark.parametrize("name", DEFECTS)
def test_a_defect_is_found(rig, name):
    change, axes, medium = DEFECTS[name]
    flight = radiance(rig, homogeneous(2.0, **medium), change=change, **axes)
    with pytest.raises(AssertionError, match="mean"):
        check_mean(flight.run(8192).moments, flight.reference(), ALPHA)


def test_a_weight_lost_in_roulette_is_found(rig):
    change = Change("path->weight / largest", "path->weight")
    medium = homogeneous(2.0, albedo=0.3, phase="rod")
    with pytest.raises(AssertionError):
        rays = {"orthographic": {"resolution": 4}}
        one = radiance(rig, medium, rays=rays, change=change).run(8192)
        k = np.sqrt(0.7)
        r = (1 - k) / (1 + k)
        damped = 1 - r**2 * np.exp(-4 * k)
        through = (1 - r**2) * np.exp(-2 * k) / damped
        back = r * (1 - np.exp(-4 * k)) / damped
        check_mean(one.moments, np.full(16, through + back), ALPHA)
