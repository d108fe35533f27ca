"""Defects of random numbers and of counting."""

from __future__ import annotations

from freepath.check.planted import HARD, PARTS, Defect

NUMBERS = (
    # random numbers
    Defect(
        "log(u + eps)",
        "-logarithm((SCALAR)1 - uniform(rng))",
        "-logarithm((SCALAR)1 - uniform(rng) + (SCALAR)1e-6)",
        f"{PARTS}/extremes/1-lanes",
    ),
    Defect(
        "u = 1 possible",
        "to_real(next_bits(rng) >> 8) * (SCALAR)5.9604644775390625e-8",
        "to_real(next_bits(rng)) * (SCALAR)2.3283064365386963e-10",
        f"{PARTS}/extremes/16-lanes",
    ),
    Defect(
        "free paths of a bent distribution",
        "return -logarithm((SCALAR)1 - uniform(rng));",
        "const real u = uniform(rng);\n"
        "return -logarithm((SCALAR)1 - u - 0.3f * u * (1.0f - u) * (1.0f - 2.0f * u));",
        "distribution/analytic/free_path/homogeneous/global",
    ),
    Defect(
        "one stream for all samples of a ray",
        "{ray, low, high, (bits)0}",
        "{ray, (bits)0, high, (bits)0}",
        f"{PARTS}/disjoint/16-lanes",
    ),
    Defect(
        "one stream for all rays",
        "{ray, low, high, (bits)0}",
        "{(bits)0, low, high, (bits)0}",
        f"{PARTS}/disjoint/16-lanes",
    ),
    Defect(
        "one stream for every two rays",
        "{ray, low, high, (bits)0}",
        "{ray >> 1, low, high, (bits)0}",
        "identity/delta/transmittance/homogeneous/global",
    ),
    Defect(
        "one stream for every two samples of a ray",
        "{ray, low, high, (bits)0}",
        "{ray, low >> 1, high, (bits)0}",
        "identity/delta/transmittance/homogeneous/global",
    ),
    Defect(
        "sample numbers that wrap at 2^32",
        "(bits)(uint)(first >> 32) + carry(low, offset)",
        "(bits)(uint)(first >> 32)",
        f"{PARTS}/streams/16-lanes",
    ),
    Defect("nine rounds of Philox", "round < 10", "round < 9", f"{PARTS}/known-answers/1-lanes"),
    Defect(
        "another rotation in xoshiro",
        "rotate_left(rng->s3, 11)",
        "rotate_left(rng->s3, 12)",
        f"{PARTS}/published/16-lanes",
    ),
    Defect(
        "reused random numbers: the control draws what the residual draws",
        "Rng control_rng = companion(rng);",
        "Rng control_rng = *rng;",
        "moments/decomposition/exponential/global",
    ),
    Defect(
        "samples numbered within their block",
        "block * (index)(INTEGER)samples + tally->done;",
        "tally->done;",
        f"{HARD}/long-runs/blocks",
    ),
    # counting
    Defect(
        "a lookup counted twice",
        "count(path->lookups, here);",
        "path->lookups -= 2 * here;",
        "moments/delta/trilinear/grid",
    ),
    Defect(
        "a lookup that is not counted",
        "count(path->lookups, here);",
        "",
        "moments/delta/trilinear/grid",
    ),
    Defect(
        "violations that are not counted",
        "count(path->violations, here & less(path->majorant * (SCALAR)1.000001, sigma));",
        "",
        f"{HARD}/non-bounding/0.5/delta",
    ),
    Defect(
        "scores that are not finite and not counted",
        "tally->nonfinite -= ended & ~less(fabs(sum), (real)INFINITY);",
        "",
        f"{HARD}/accumulation/nonfinite",
    ),
    Defect(
        "scores that are no number counted only where they are infinite",
        "~less(fabs(sum), (real)INFINITY);",
        "equal(fabs(sum), (real)INFINITY);",
        f"{HARD}/accumulation/nonfinite",
    ),
    Defect(
        "paths cut off without being counted",
        "tally->truncated -= truncated;",
        "",
        f"{HARD}/loose/step-cap/ratio",
    ),
    Defect(
        "a step cap that is not where it should be",
        "~less(path.steps, (index)(INTEGER)step_cap)",
        "~less(path.steps, (index)(INTEGER)step_cap * 2)",
        f"{HARD}/loose/step-cap/ratio",
    ),
    Defect(
        "a mean that stands still in float",
        "const real excess = mean - tally->mean[i] - rise;",
        "const real excess = (real)0;",
        f"{HARD}/accumulation/still-mean",
    ),
    Defect(
        "squares of deviations from the old mean",
        "deviation * (x - mean + excess)",
        "deviation * deviation",
        f"{HARD}/accumulation/sixteen-million",
    ),
)
