"""Generators, the logarithm, and samplers at the ends of their domain."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import stats

from freepath.checks.generators import philox, stream, xoshiro
from freepath.checks.media import MEDIA
from freepath.checks.model import TINY
from freepath.checks.parts import Lanes
from freepath.checks.rig import Change, Rig
from freepath.checks.suite.common import Checks, everyone, fly, has_free_path, knows_depth
from freepath.checks.verdict import demand, require
from freepath.compose import kernel_files
from freepath.compose.catalog import Tracker
from freepath.config.models import MEDIA as MODELS

GROUP = "random-numbers"
# Random123-1.14, tests/kat_vectors: philox4x32 with 10 rounds; counter, key, result
KNOWN = [
    ([0, 0, 0, 0], [0, 0], [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8]),
    ([0xFFFFFFFF] * 4, [0xFFFFFFFF] * 2, [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD]),
    (
        [0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344],
        [0xA4093822, 0x299F31D0],
        [0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1],
    ),
]
WORDS = "out0 = rng.s0; out1 = rng.s1; out2 = rng.s2; out3 = rng.s3;"
ULP = {"log_polynomial": 1.0, "log_builtin": 3.0}
"""What a logarithm may be off: OpenCL grants its own 3; ours is off by 0.83 at most."""
# Of four draws one is 0, one the smallest above 0, one the largest below 1, and one as drawn.
ENDS = Change(
    "return to_real(next_bits(rng) >> 8) * (SCALAR)5.9604644775390625e-8;",
    "const bits drawn = next_bits(rng);\n"
    "    const bits which = drawn & 3u;\n"
    "    const bits ends = (which >> 1) * ((which & 1u) ? drawn >> 8 : (bits)0xffffffu)\n"
    "        + ((which >> 1) ^ 1u) * which;\n"
    "    return to_real(ends) * (SCALAR)5.9604644775390625e-8;",
)


checks = Checks()


def part(name: str, lanes: tuple[int, ...] = (1, 16), /, **options: Any) -> Any:
    """Decorate a check of a part of the kernels in so many lanes."""

    def declare(function: Any) -> Any:
        for count in lanes:
            tiny = (TINY,) if options.get("tiny") and count == 1 else ()
            own = {key: value for key, value in options.items() if key != "tiny"} | {"lanes": count}
            own["labels"] = (*own.get("labels", ("fast",)), *tiny)
            checks.one(f"{GROUP}/{name}/{count}-lanes", kernels=GROUP, **own)(function)
        return function

    return declare


@part("known-answers", tiny=True)
def known_answers(rig: Rig, alpha: float, lanes: int) -> None:
    """A swapped word or key makes a generator that only looks random."""
    # Of the generator's authors, in each lane.
    for counter, key, expected in KNOWN:
        body = f"const Rng c = {{in0, in1, in2, in3}}; rng = philox(c, {key[0]}u, {key[1]}u);"
        found = Lanes(rig, lanes)(body + WORDS, [[word] for word in counter], ["bits"] * 4, 40)
        for words, word in zip(found, expected, strict=True):
            demand((words == word).all(), f"{words.flat[0]:#x} for {counter}, expected {word:#x}")


@part("own-counters")
def own_counters(rig: Rig, alpha: float, lanes: int) -> None:
    """Lanes that mix their counters draw the same numbers."""
    # Each lane has the answer of its own.
    counters = np.random.default_rng(1).integers(0, 2**32, (4, 48))
    body = f"const Rng c = {{in0, in1, in2, in3}}; rng = philox(c, 1u, 2u);{WORDS}"
    found = np.hstack(Lanes(rig, lanes)(body, counters, ["bits"] * 4, 48))
    same = found == np.column_stack(philox(counters, (1, 2)))
    demand(same.all(), f"{np.count_nonzero(~same)} of {same.size} words are of other counters")


@part("published", tiny=True)
def published(rig: Rig, alpha: float, lanes: int) -> None:
    """A generator with another rotation fails tests only its authors ran."""
    # A hundred numbers of forty states; the first of 1, 2, 3, 4 are the authors'.
    states = np.random.default_rng(2).integers(0, 2**32, (4, 40))
    states[:, 0] = 1, 2, 3, 4
    body = "if (n == 0) { rng.s0 = in0; rng.s1 = in1; rng.s2 = in2; rng.s3 = in3; }"
    body += "out0 = next_bits(&rng);"
    (found,) = Lanes(rig, lanes)(body, states, ["bits"], 40, draws=100)
    numbers = xoshiro([np.asarray(word, np.uint64) for word in states])
    expected = np.column_stack([next(numbers) for _ in range(100)])
    demand((found == expected).all(), "its numbers are not those of xoshiro128++")
    authors = [641, 1573767, 3222811527, 3517856514, 836907274]
    demand(found[0, :5].tolist() == authors, "its first numbers are not the authors'")


@part("streams")
def streams(rig: Rig, alpha: float, lanes: int) -> None:
    """Sample numbers that wrap at 2^32 repeat the samples of a long run."""
    # Of rays and samples beyond 2^32.
    rays, offsets = np.array([0, 1, 7, 2**31, 2**32 - 1]), np.array([0, 1, 5, 2**31, 2**32 - 1])
    for first in (0, 2**32 - 3, 2**40 + 2**32 - 1):
        body = f"rng = stream({2**53 + 5}ul, in0, {first}ul, in1);{WORDS}"
        found = np.hstack(Lanes(rig, lanes)(body, [rays, offsets], ["bits"] * 4, 5))
        expected = np.column_stack(stream(2**53 + 5, rays, first + offsets))
        demand((found == expected).all(), f"other streams than Philox gives from {first} on")


@part("disjoint")
def disjoint(rig: Rig, alpha: float, lanes: int) -> None:
    """Samples that share a stream have errors that do not average out."""
    # A million of 64 rays, from starts on either side of 2^32.
    ray, offset = np.meshgrid(np.arange(64), np.arange(2**13), indexing="ij")
    seen = []
    for first in (0, 2**32 - 2**12):
        body = f"rng = stream(seed, in0, {first}ul, in1);{WORDS}"
        found = Lanes(rig, lanes)(body, [ray.ravel(), offset.ravel()], ["bits"] * 4, ray.size)
        seen.append(np.hstack(found))
    states = np.ascontiguousarray(np.vstack(seen)).view(np.uint64)
    # sorting half of a state is quick, and hardly any other has the same half
    half = np.sort(states[:, 0])
    alike = states[np.isin(states[:, 0], half[1:][half[1:] == half[:-1]])]
    shared = len(alike) - len(np.unique(alike, axis=0))
    demand(shared == 0, f"{shared} of {len(states)} samples share a stream")


@part("extremes")
def extremes(rig: Rig, alpha: float, lanes: int) -> None:
    """u = 1 or log 0 is infinite, and 0 must be a depth of 0."""
    # The smallest and largest bits: in [0, 1), and finite.
    # from s0 = 0 the generator returns s3 rotated by 7
    body = "if (n == 0) { rng.s0 = (bits)0; rng.s1 = rng.s2 = (bits)1; rng.s3 = in0; }"
    body += "Rng copy = rng; out0 = uniform(&rng); out1 = exponential(&copy);"
    words = np.array([0, 0xFFFFFFFF, 1 << 1, 0xFE])
    u, depth = Lanes(rig, lanes)(body, [words], ["real", "real"], 4)
    exact = ((words << 7 | words >> 25) & 0xFFFFFFFF) >> 8
    demand((u[:, 0] == exact * 2.0**-24).all(), f"uniforms {u[:, 0]}, expected {exact} x 2^-24")
    demand(depth[0, 0] == 0.0, f"u = 0 gives the depth {depth[0, 0]}")
    largest = 24.0 * np.log(2.0)
    demand(abs(depth[1, 0] / largest - 1.0) < 1e-6, f"1 - 2^-24 gives {depth[1, 0]}")


@part("distribution")
def distribution(rig: Rig, alpha: float, lanes: int) -> None:
    """An epsilon in log(1 - u + eps) cuts the tail of free paths."""
    # Sixteen million draws, with the whole of the exponential's tail.
    count, draws = 2**16, 2**8
    body = "if (n == 0) rng = stream(seed, in0, 0ul, in1);"
    body += "Rng copy = rng; out0 = uniform(&rng); out1 = exponential(&copy);"
    ray = np.arange(count)
    u, depth = Lanes(rig, lanes)(body, [ray, ray % 7], ["real", "real"], count, draws)
    demand(u.min() >= 0.0 and u.max() < 1.0, f"uniforms from {u.min()} to {u.max()}")
    demand(np.isfinite(depth).all(), "an infinite optical depth")
    total = count * draws
    p_values = [stats.chisquare(np.bincount((1024 * u.ravel()).astype(int), minlength=1024)).pvalue]
    centred = u.astype(np.float64) - 0.5
    # successive draws of a stream, and the same draw of neighbouring streams
    for one, other in ((centred[:, 1:], centred[:, :-1]), (centred[1:], centred[:-1])):
        correlation = 12.0 * np.einsum("sd,sd->", one, other) / one.size
        p_values.append(2.0 * stats.norm.sf(abs(correlation) * np.sqrt(one.size)))
    for limit in (1.0, 5.0, 10.0, 13.0, 16.0):
        # -log(1 - u) of multiples of 2^-24 exceeds the limit this often, exactly
        share = (np.ceil(np.exp(-limit) * 2.0**24) - 1) * 2.0**-24
        excess = np.count_nonzero(depth > limit)
        tails = stats.binom.cdf(excess, total, share), stats.binom.sf(excess - 1, total, share)
        p_values.append(min(1.0, 2.0 * min(tails)))
    require(np.array(p_values), alpha, "uniform, correlations (2), tail beyond 1, 5, 10, 13, 16")


@part("twenty-free-paths")
def twenty_free_paths(rig: Rig, alpha: float, lanes: int) -> None:
    """A tail that is cut shows first far out."""
    # P(X > 20) = 2e-9 as a sum of two depths: a path's depth, as collisions add them up.
    count, draws = 2**16, 2**8
    body = "if (n == 0) rng = stream(seed, in0, 1ul, in1);"
    body += "out0 = exponential(&rng) + exponential(&rng) + exponential(&rng) + exponential(&rng);"
    ray = np.arange(count)
    (sums,) = Lanes(rig, lanes)(body, [ray, ray % 5], ["real"], count, draws)
    beyond, total = np.count_nonzero(sums > 20.0), sums.size
    share = stats.gamma.sf(20.0, 4)
    tails = stats.binom.cdf(beyond, total, share), stats.binom.sf(beyond - 1, total, share)
    p_value = np.array([min(1.0, 2.0 * min(tails))])
    found, expected = np.array([beyond / total]), np.array([share])
    require(p_value, alpha, "share beyond 20 mean free paths", found, expected)


@part("never-1", (16,), labels=("slow",))
def never_1(rig: Rig, alpha: float, lanes: int) -> None:
    """1e9 draws never give 1: its logarithm would be infinite, and a float conversion that rounds
    up gives it once in 33 million."""
    # On the device: the largest of a hundred thousand draws of ten thousand streams.
    count, inner = 2**14, 2**16
    body = f"""
    rng = stream(seed, in0, 2ul, in1);
    real most = (real)0;
    for (uint i = 0; i < {inner}u; ++i) {{ const real u = uniform(&rng); most = larger(u, most); }}
    out0 = most;"""
    ray = np.arange(count)
    (most,) = Lanes(rig, lanes)(body, [ray, ray % 3], ["real"], count)
    demand(most.max() < 1.0, f"the largest of {count * inner} draws is {most.max()}")
    demand(most.max() == 1.0 - 2.0**-24, "the largest uniform was not met in 1e9 draws")


def logarithm(rig: Rig, alpha: float, lanes: int, name: str) -> None:
    """A logarithm that is off, or not monotone, near 1 or at 2^-24 bends every free path."""
    # All 2^24 values of 1 - u.
    k = np.arange(2**24, dtype=np.uint32)
    body = "out0 = logarithm((SCALAR)1 - to_real(in0) * 0x1p-24f);"
    (found,) = Lanes(rig, lanes, name)(body, [k], ["real"], len(k))
    found = found[:, 0].astype(np.float64)
    exact = np.log1p(-k.astype(np.float64) * 2.0**-24)
    demand(found[0] == 0.0, f"the logarithm of 1 is {found[0]}")
    ulp = np.spacing(np.abs(exact[1:]).astype(np.float32)).astype(np.float64)
    error = np.max(np.abs(found[1:] - exact[1:]) / ulp)
    demand(error <= ULP[name], f"off by {error:.3g} units in the last place")
    demand((np.diff(found) <= 0.0).all(), "it falls where its argument rises")


@checks.hard("random-numbers/ends", everyone)
def ends(rig: Rig, alpha: float, tracker: Tracker, medium: str = "") -> None:
    """With u = 0, 2^-24 and 1 - 2^-24 fed into every decision, a sampler that divides by what is
    left, or takes the logarithm of 0, becomes no number or runs on for ever."""
    # Finite and within the ray, whatever is drawn; a path that goes on is cut off and counted.
    rig = rig.with_change(ENDS)
    medium = medium or ("layered" if "closed_form" in tracker.needs else "trilinear")
    axes: dict[str, Any] = {"estimand": tracker.estimands[-1], "tightness": 1.5}
    rays = {"chords": {"count": 64}}
    flight = fly(rig, tracker, medium, rays=rays, **axes)
    demand(ENDS.planted, "the draws could not be replaced by the ends of their range")
    samples = flight.record(512)
    counted = samples.round.counters
    demand(not counted["nonfinite"], f"{counted['nonfinite']} scores are no numbers")
    demand(not counted["truncated"], f"{counted['truncated']} paths go on for ever")
    demand((samples.t >= 0.0).all(), "a path that ends before it begins")
    beyond = np.max(samples.t - flight.segments[:, 6:])
    demand(beyond <= 1e-5, f"a path ends {beyond:.3g} beyond its ray")


@checks.one("random-numbers/circle")
def circle(rig: Rig, alpha: float) -> None:
    """A series that is off by a part in 1000 turns directions, and makes them longer than 1: no
    mean tells."""
    u = np.arange(0, 2**24, 127)
    code = kernel_files.read("math/circle_polynomial").code
    body = "point_on_circle(to_real(in0) * 0x1p-24f, &out0, &out1);"
    found = np.array(Lanes(rig, 16, more=code)(body, [u], ["real"] * 2, len(u)), float)[..., 0]
    angle = 2.0 * np.pi * u / 2**24
    error = np.abs(found - np.array([np.cos(angle), np.sin(angle)])).max()
    demand(error < 4 * 2.0**-24, f"a point of the circle is off by {error:.3g}")


for name in ULP:
    part(f"logarithm-{name}", (16,), name=name)(logarithm)
for medium in MEDIA:
    if "closed_form" in MODELS[next(iter(MEDIA[medium]))].OFFERS:
        checks.hard(
            f"{GROUP}/inverse-{medium}",
            lambda t: knows_depth(t) and has_free_path(t),
            sentence="""The inverse of a closed form at u = 0 and at the largest u divides 0 by
            0, or Newton's method leaves its bracket.""",
            medium=medium,
        )(ends)
