"""The project's random numbers in Python: what kernels must draw, to the bit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

Words = list[NDArray[np.uint64]]
LOW = np.uint64(0xFFFFFFFF)


def philox(counter: Sequence[NDArray[np.uint64]], key: tuple[int, int]) -> Words:
    """Salmon et al. 2011, section 3.3: Philox 4x32-10 of four arrays of words."""
    a, b, c, d = (np.asarray(word, np.uint64) for word in counter)
    key0, key1 = key
    for _ in range(10):
        first, second = np.uint64(0xD2511F53) * a, np.uint64(0xCD9E8D57) * c
        high = second >> np.uint64(32) ^ b ^ np.uint64(key0)
        a, b, c, d = high, second & LOW, first >> np.uint64(32) ^ d ^ np.uint64(key1), first & LOW
        key0, key1 = key0 + 0x9E3779B9 & 0xFFFFFFFF, key1 + 0xBB67AE85 & 0xFFFFFFFF
    return [a, b, c, d]


def xoshiro(state: Words) -> Iterator[NDArray[np.uint64]]:
    """Blackman and Vigna 2021: the numbers of xoshiro128++ from a state of four arrays."""

    def rotated(x: NDArray[np.uint64], k: int) -> NDArray[np.uint64]:
        return (x << np.uint64(k) | x >> np.uint64(32 - k)) & LOW

    a, b, c, d = state
    while True:
        yield (rotated(a + d & LOW, 7) + a) & LOW
        shifted = b << np.uint64(9) & LOW
        c, d = c ^ a, d ^ b
        b, a = b ^ c, a ^ d
        c, d = c ^ shifted, rotated(d, 11)


def stream(seed: int, ray: NDArray[np.int64], sample: NDArray[np.int64]) -> Words:
    """The state that sample numbers of rays begin with."""
    number = np.asarray(sample, np.uint64)
    counter = [ray, number & LOW, number >> np.uint64(32), np.zeros_like(number)]
    return philox(counter, (seed & 0xFFFFFFFF, seed >> 32))


def first_depths(seed: int, rays: int, samples: int) -> NDArray[np.float64]:
    """The optical depths (rays, samples) that trackers draw which draw one before all else."""
    ray, sample = np.meshgrid(np.arange(rays), np.arange(samples), indexing="ij")
    bits = next(xoshiro(stream(seed, ray, sample)))
    return -np.log1p(-(bits >> np.uint64(8)).astype(np.float64) * 2.0**-24)
