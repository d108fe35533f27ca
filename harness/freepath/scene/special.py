"""Functions whose textbook forms cancel or divide by zero, in forms that keep every digit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]

#: Nodes and weights of the 16-point Gauss-Legendre rule on [0, 1].
NODES = (special.roots_legendre(16)[0] + 1.0) / 2.0
WEIGHTS = special.roots_legendre(16)[1] / 2.0


def decay_mean(x: Array) -> Array:
    """Return (1 - exp(-x)) / x, the mean of exp(-s) over [0, x]; 1 at x = 0. Needs x >= 0."""
    safe = np.where(x == 0.0, 1.0, x)
    return np.where(x == 0.0, 1.0, -np.expm1(-safe) / safe)


def log1p_ratio(x: Array) -> Array:
    """Return log(1 + x) / x; 1 at x = 0. Needs x > -1."""
    safe = np.where(x == 0.0, 1.0, x)
    return np.where(x == 0.0, 1.0, np.log1p(safe) / safe)


def gauss_integral(lower: Array, width: Array) -> Array:
    """Return the integral of exp(-x^2) over [lower, lower + width], width >= 0.

    The difference of two error functions loses all digits where both ends lie in the same tail.
    There it is taken as exp(-a^2) (erfcx(a) - exp(a^2 - b^2) erfcx(b)), with the scaled
    complement erfcx(x) = exp(x^2) erfc(x), and over short intervals by quadrature.
    """
    near = np.where(lower + width <= 0.0, -(lower + width), lower)
    far = near + width
    both_sides = special.erf(far) - special.erf(near)
    tail = np.maximum(near, 0.0)
    drop = width * (far + tail)
    one_side = np.exp(-(tail**2)) * (special.erfcx(tail) - np.exp(-drop) * special.erfcx(far))
    result = np.sqrt(np.pi) / 2.0 * np.where(near < 0.0, both_sides, one_side)
    short = (near >= 0.0) & (drop < 1.0)
    samples = near[short, None] + width[short, None] * NODES
    result[short] = width[short] * (np.exp(-(samples**2)) @ WEIGHTS)
    return result


def sinc(x: Array) -> Array:
    """Return sin(x) / x; 1 at x = 0."""
    return np.sinc(x / np.pi)


def sinc_complement(x: Array) -> Array:
    """Return 1 - sin(x) / x without the cancellation at small x (there by its Taylor series)."""
    square = x * x
    series = np.zeros_like(square)
    for order in range(9, 0, -1):
        series = square / ((2 * order) * (2 * order + 1)) * (1.0 - series)
    return np.where(square < 1.0, series, 1.0 - sinc(x))
