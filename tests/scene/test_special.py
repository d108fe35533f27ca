import numpy as np
import pytest
from scipy.integrate import quad

from freepath.scene import special


@pytest.mark.parametrize(
    ("function", "x", "expected"),
    [
        (special.decay_mean, 0.0, 1.0),
        (special.decay_mean, 1e-9, 1.0 - 0.5e-9),
        (special.decay_mean, 5e-324, 1.0),
        (special.decay_mean, 1e4, 1e-4),
        (special.log1p_ratio, 0.0, 1.0),
        (special.log1p_ratio, 1e-9, 1.0 - 0.5e-9),
        (special.log1p_ratio, -0.5, 2.0 * np.log(2.0)),
        (special.sinc, 0.0, 1.0),
        (special.sinc, np.pi / 2.0, 2.0 / np.pi),
        (special.sinc_complement, 0.0, 0.0),
        (special.sinc_complement, 1e-9, 1e-18 / 6.0),
        (special.sinc_complement, 0.999, 1.0 - np.sin(0.999) / 0.999),
        (special.sinc_complement, -1.001, 1.0 - np.sin(1.001) / 1.001),
    ],
)
def test_known_values(function, x, expected):
    assert function(np.array([x]))[0] == pytest.approx(expected, rel=2e-15, abs=0.0)


@pytest.mark.parametrize("lower", [-30.0, -6.0, -1.0, -0.3, 0.0, 0.2, 5.0, 25.9])
@pytest.mark.parametrize("width", [1e-12, 1e-3, 0.3, 2.0, 40.0])
def test_gauss_integral_keeps_digits_in_the_tails(lower, width):
    # scaled by its largest value, so that quad sees numbers near 1 where the integral underflows
    nearest = min(max(0.0, lower), lower + width)

    def integrand(s):
        x = lower + s
        return np.exp(nearest**2 - x * x)

    cuts = np.unique(
        np.clip([0.0, *(nearest - lower + np.arange(-9.0, 9.5, 0.5)), width], 0, width)
    )
    scaled = sum(
        quad(integrand, a, b, epsabs=0, epsrel=1e-13)[0]
        for a, b in zip(cuts[:-1], cuts[1:], strict=True)
    )
    expected = scaled * np.exp(-(nearest**2))
    result = special.gauss_integral(np.array([lower]), np.array([width]))[0]
    assert result == pytest.approx(expected, rel=1e-12, abs=0.0)
