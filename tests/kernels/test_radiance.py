"""Paths that scatter: what does not change a sample. The checks of the group scattering do more."""

import numpy as np
import pytest

from freepath.checks.identities import check_mean
from freepath.checks.rig import Change
from freepath.compose import light_paths as effects
from freepath.measure import runner

GRID = {"cloud": {"resolution": 16, "interpolation": "trilinear"}}
POINT = {"point": {"position": [0.3, 0.4, 2.0], "intensity": 10}}


def radiance(rig, medium, tracker="delta", **axes):
    return rig.flight(
        **{"estimand": "radiance", "medium": medium, "tracker": tracker, "lanes": 16} | axes
    )


def test_everything_gives_what_the_scene_has(rig):
    """`effects: all` compiles more and returns the same, sample for sample."""
    medium = {"homogeneous": {"sigma_t": 2.0, "albedo": 0.8}}
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


@pytest.mark.parametrize(
    ("tracker", "shadow", "arithmetic"),
    [
        ("delta", "ratio", "strict"),
        ("delta", "delta", "double"),
        ("weighted_delta", "next_flight_ratio", "strict"),
        ("spectral", "spectral_ratio", "strict"),
    ],
)
def test_lanes_with_a_mode_give_the_samples_of_an_inner_loop(
    rig, monkeypatch, tracker, shadow, arithmetic
):
    medium = {"cloud": GRID["cloud"] | {"sigma_t": 10, "albedo": 0.9, "g": 0.3}}
    if tracker == "spectral":
        medium["cloud"] |= {"channels": [1, 0.5, 0.2], "albedo": [0.9, 0.5, 0.7]}
    axes = {"light": POINT, "majorant": "grid", "shadow": shadow, "tracker": tracker}
    axes["arithmetic"] = arithmetic
    monkeypatch.setattr(effects, "modes_pay", lambda medium, channels: True)
    modes = radiance(rig, medium, **axes)
    monkeypatch.setattr(effects, "modes_pay", lambda medium, channels: False)
    loop = radiance(rig, medium, **axes)
    found = ["shadow_mode.cl" in one.runner.program.source.text for one in (modes, loop)]
    assert found == [True, False]
    one, other = modes.record(64), loop.record(64)
    same = np.isclose(one.scores, other.scores, rtol=1e-3, atol=1e-6)
    assert same.mean() > 0.999
    assert abs(one.lookups.sum() / other.lookups.sum() - 1) < 1e-3


def test_a_lane_has_a_mode_where_that_is_faster(rig):
    grid = {"cloud": GRID["cloud"] | {"sigma_t": 10, "albedo": 0.9}}
    three = {"cloud": grid["cloud"] | {"channels": [1, 0.5, 0.2]}}
    axes = {"light": POINT, "majorant": "grid"}
    chosen = [
        radiance(rig, {"homogeneous": {"sigma_t": 2.0, "albedo": 0.5}}, **axes),
        radiance(rig, grid, tracker="regular", **axes),
        radiance(rig, grid, shadow="residual_ratio", tracker="decomposition", **axes),
        radiance(rig, three, tracker="spectral", shadow="spectral_ratio", **axes),
        radiance(rig, grid, **axes),
    ]
    found = ["shadow_mode.cl" in one.runner.program.source.text for one in chosen]
    assert found == [False, False, False, False, True]


def test_a_path_cut_off_on_a_shadow_ray_leaves_the_next_its_ray(rig, monkeypatch):
    """Samples of a unit, one after the other, are those that are taken one a unit."""
    monkeypatch.setattr(runner, "STEP_CAP", 6)
    short = rig
    for name in ("MOST_STEPS", "SHADOW_STEPS"):
        short = short.with_change(Change(f"#define {name} (1 << 20)", f"#define {name} 6"))
    medium = {"cloud": GRID["cloud"] | {"sigma_t": 10, "albedo": 0.9, "g": 0.3}}
    flight = radiance(short, medium, light=POINT, majorant="grid")
    assert "shadow_mode.cl" in flight.runner.program.source.text
    together, apart = flight.record(64), flight.record(1, blocks=64)
    assert together.round.counters["truncated"] > 100
    np.testing.assert_array_equal(together.score, apart.score)


def test_a_tracker_of_shadow_rays_brings_the_mathematics_that_it_uses(rig):
    """Unbiased marching needs a file of kernels/math that no other tracker of the source does."""
    medium = {"homogeneous": {"sigma_t": 2.0, "albedo": 0.5}}
    flight = radiance(rig, medium, light=POINT, scatterings=1, shadow="unbiased_march")
    assert "symmetric_means" in flight.runner.program.source.text
    check_mean(flight.run(4096).moments, flight.reference(), 1e-4)


def test_a_shadow_ray_may_march(rig):
    """A parameter of its is called `step`, which is a function of OpenCL, and of PoCL a macro."""
    medium = {"homogeneous": {"sigma_t": 2.0, "albedo": 0.8}}
    lit = {"medium": medium, "light": POINT, "scatterings": 1, "lanes": 1}
    marched, exact = (
        radiance(rig, shadow=shadow, **lit).record(32).score for shadow in ("march", "regular")
    )
    np.testing.assert_allclose(marched, exact, rtol=1e-4, atol=1e-6)
    assert exact.max() > 0
