"""Environments from images: furnaces, what is seen through a medium and after scattering."""

import numpy as np
import OpenImageIO as oiio
import pytest

from freepath.checks.identities import check_mean
from freepath.checks.rig import Change
from freepath.measure.stats import Moments

ALPHA = 1e-4
RAYS = {"chords": {"count": 256}}


@pytest.fixture
def image(tmp_path):
    """Write pixels [rows, columns, channels] as an EXR file; returns the light of it."""

    def image(pixels, **keys):
        path = tmp_path / "sky.exr"
        assert oiio.ImageBuf(np.ascontiguousarray(pixels, np.float32)).write(str(path))
        return {"image": {"file": str(path), **keys}}

    return image


def radiance(rig, medium, light, tracker="delta", **axes):
    return rig.flight(
        **{"estimand": "radiance", "medium": medium, "tracker": tracker, "light": light}
        | {"lanes": 16, "rays": RAYS}
        | axes
    )


def homogeneous(sigma_t=2.0, **keys):
    return {"homogeneous": {"sigma_t": sigma_t, **keys}}


def halves(first, second, axis):
    """An image of a bright and of another half, cut across an axis."""
    shape = (2, 4) if axis == 0 else (1, 2)
    parts = np.full((*shape, 1), np.float32(first))
    half = shape[axis] // 2
    parts[(slice(None),) * axis + (slice(half, None),)] = second
    return parts


def random_image():
    return np.random.default_rng(4).random((128, 256, 1)) ** 4


@pytest.mark.parametrize("lanes", [1, 16])
@pytest.mark.parametrize(
    "medium",
    [
        homogeneous(10.0, albedo=1, g=0.5),
        {"cloud": {"resolution": 16, "sigma_t": 20, "albedo": 1, "size": [1, 3, 0.5]}},
    ],
)
def test_furnace(rig, image, medium, lanes):
    """A constant image is a uniform environment: every path returns it."""
    light = image(np.full((7, 3, 1), 0.25), scale=8)
    one = radiance(rig, medium, light, lanes=lanes).run(32)
    np.testing.assert_allclose(one.moments.mean, 2.0, rtol=1e-5)


@pytest.mark.parametrize("arithmetic", ["strict", "fast", "double"])
@pytest.mark.parametrize("tracker", ["delta", "regular", "spectral"])
def test_through_what_only_absorbs(rig, image, tracker, arithmetic):
    """exp(-tau) times the image in the ray's direction, and no code that scatters."""
    light = image(random_image())
    axes = {"arithmetic": arithmetic, "majorant": "grid"}
    flight = radiance(rig, {"cloud": {"resolution": 16, "sigma_t": 4}}, light, tracker, **axes)
    assert "scatter(" not in flight.runner.program.source.text
    check_mean(flight.run(4096).moments, flight.reference(), ALPHA)


AXES = np.concatenate([np.eye(3), -np.eye(3)])


def test_where_the_image_shows(rig, image):
    """In vacuum each ray returns the pixel that it looks at: the axes, by hand."""
    pixels = np.zeros((4, 8, 3))
    pixels[0], pixels[-1] = [9, 9, 9], [7, 7, 7]
    #  ... -x | +y | +x | -y | -x ..., each in the middle of two columns
    for columns, value in (((3, 4), 1), ((1, 2), 2), ((7, 0), 3), ((5, 6), 4)):
        pixels[1:3, columns, :] = value
    medium = homogeneous(1e-20, channels=[1, 1, 1])
    lines = (0.5 - 2 * AXES, AXES)
    flight = radiance(rig, medium, image(pixels, scale=0.5), "spectral", lines=lines)
    expected = np.array([1, 2, 9, 3, 4, 7]) / 2
    np.testing.assert_allclose(flight.run(2).moments.mean, expected[:, None] * np.ones(3))
    np.testing.assert_allclose(flight.reference(), expected[:, None] * np.ones(3))


def test_rows_next_to_the_poles_meet(rig, image):
    """Around a pole the image is continuous: there it is the mean of its row."""
    angles = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    directions = np.stack([1e-6 * np.cos(angles), 1e-6 * np.sin(angles), np.ones(64)], axis=1)
    pixels = random_image()
    lines = (0.5 - 2 * directions, directions)
    flight = radiance(rig, homogeneous(1e-20), image(pixels), lines=lines)
    pole = pixels[:2].mean()
    np.testing.assert_allclose(flight.run(2).moments.mean, pole, rtol=1e-3)
    np.testing.assert_allclose(flight.reference(), pole, rtol=1e-3)


@pytest.mark.parametrize("albedo", [0.4, 1.0])
def test_a_bright_half_before_and_behind(rig, image, albedo):
    """In the rod model light comes from ahead and from behind: transmission and reflection."""
    depth, ahead, behind = 2.0, 3.0, 0.5
    light = image(halves(behind, ahead, 1)[:, [0, 1, 1, 0]])  # -x is at both ends
    rays = {"orthographic": {"resolution": 4, "direction": [1, 0, 0]}}
    medium = homogeneous(depth, albedo=albedo, phase="rod")
    one = radiance(rig, medium, light, rays=rays).run(8192)
    if albedo == 1:
        through, back = 2 / (2 + depth), depth / (2 + depth)
    else:
        k = np.sqrt(1 - albedo)
        r = (1 - k) / (1 + k)
        damped = 1 - r**2 * np.exp(-2 * k * depth)
        through = (1 - r**2) * np.exp(-k * depth) / damped
        back = r * (1 - np.exp(-2 * k * depth)) / damped
    check_mean(one.moments, np.full(16, through * ahead + back * behind), ALPHA)


def test_half_of_what_scatters_comes_from_a_bright_half(rig, image):
    """Along the horizon of a cube's middle, above and below are alike: half of it is bright."""
    rays = {"single": {"origin": [-1, 0.5, 0.5], "direction": [1, 0, 0]}}
    medium = homogeneous(4.0, albedo=1)
    one = radiance(rig, medium, image(halves(2, 0, 0)), rays=rays).run(512, 256)
    check_mean(one.moments, np.ones(1), ALPHA)
    assert one.moments.variance.min() > 0.5


@pytest.mark.parametrize("effects", ["auto", "all"])
def test_each_channel_sees_its_own(rig, image, effects):
    """Where albedo is 1 a constant image comes back, whatever the channels' extinctions."""
    light = image(np.broadcast_to([1.0, 0.5, 0.25], (2, 4, 3)))
    grey = radiance(rig, homogeneous(3.0, albedo=1), light, effects=effects).run(64)
    np.testing.assert_allclose(grey.moments.mean, 1.75 / 3, rtol=1e-5)
    if effects == "auto":
        medium = homogeneous(3.0, albedo=1, channels=[1, 0.5, 0.2])
        one = radiance(rig, medium, light, "spectral").run(4096)
        for channel, expected in enumerate([1.0, 0.5, 0.25]):
            mean, m2 = one.moments.mean[:, channel], one.moments.m2[:, channel]
            own = Moments(one.moments.count, mean, m2)
            check_mean(own, np.full(256, expected), ALPHA / 3)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("(SCALAR)0.5 - (SCALAR)0.5 * atan2pi", "(SCALAR)0.5 + (SCALAR)0.5 * atan2pi"),
        ("atan2pi(sqrt(off), ahead.z)", "atan2pi(sqrt(off), -ahead.z)"),
        ("(SCALAR)(SKY_COLUMNS - 0.5)", "(SCALAR)SKY_COLUMNS"),
        ("see_image(path, scene, ended & path->escaped)", "see_image(path, scene, ended)"),
    ],
)
def test_defects_are_found(rig, image, old, new):
    light = image(random_image())
    flight = radiance(rig.with_change(Change(old, new)), homogeneous(1.0), light)
    with pytest.raises(AssertionError):
        check_mean(flight.run(2048).moments, flight.reference(), ALPHA)


def test_scenes_without_an_image_have_none_of_it(rig):
    text = radiance(rig, homogeneous(albedo=0.5), "uniform").runner.program.source.text
    assert "sky" not in text.lower()


@pytest.mark.parametrize("tracker", ["delta", "combined"])
def test_a_point_before_an_image_brings_what_both_bring(rig, image, tracker):
    place = {"position": [0.4, 0.6, 1.5], "intensity": 4}
    light = image(random_image())
    both = {"point_in_image": light["image"] | place}
    medium = homogeneous(albedo=0.8, g=0.3)
    lights = (both, light, {"point": place})
    together, around, point = (
        radiance(rig, medium, one, tracker if one is both else "delta", scatterings=2).run(
            8192, first_sample=10000 * i
        )
        for i, one in enumerate(lights)
    )
    moments = [one.moments for one in (together, around, point)]
    joint = Moments(8192, moments[0].mean, sum(one.m2 for one in moments))
    check_mean(joint, moments[1].mean + moments[2].mean, ALPHA)
