"""Many samples, numbers beyond 32 bits, long launches, and volumes that must be refused."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy import stats

from freepath.checks.identities import check_clean, check_same_samples
from freepath.checks.model import TINY
from freepath.checks.rig import Rig
from freepath.checks.suite.common import UPWARD, Checks
from freepath.checks.verdict import Failure, demand, require
from freepath.errors import VolumeError, imported

BILLION = 1_000_000_000


checks = Checks()


def _billion(rig: Rig, alpha: float, samples: int) -> None:
    """Mean, variance and counts of delta tracking in an optical depth of a half."""
    medium = {"homogeneous": {"sigma_t": 0.5}}
    rays = {"orthographic": {"resolution": [32, 32]}}
    flight = rig.flight(tracker="delta", medium=medium, rays=rays, lanes=16, record=False)
    blocks, each = 512, samples // (1024 * 512)
    one = flight.run(each, blocks)
    check_clean(one, bounded=True)
    total, exact = one.samples, np.exp(-0.5)
    spread = np.sqrt(exact * (1.0 - exact) / total)
    lookups = one.counters["lookups"] / total
    # a lookup for each collision: 1 - T; every tentative collision is real where the bound is met
    p_values = 2.0 * stats.norm.sf(np.abs([one.estimate - exact, lookups - 1.0 + exact]) / spread)
    found, expected = np.array([one.estimate, lookups]), np.array([exact, 1.0 - exact])
    require(p_values, alpha, f"mean, lookups of {total} samples", found, expected)
    variance = float(one.moments.variance.mean())
    error = abs(variance / (exact * (1.0 - exact)) - 1.0)
    demand(error < 1e-3, f"the variance is off by {error:.3g}")
    demand(one.counters["steps"] >= total, "steps are lost")


@checks.one("accumulation/sixteen-million", kernels="long-runs")
def million(rig: Rig, alpha: float) -> None:
    """A sum in float is wrong in the third digit after 1e7 values."""
    _billion(rig, alpha, 2**24)


@checks.one("accumulation/billion", labels=("slow",), kernels="long-runs")
def billion(rig: Rig, alpha: float) -> None:
    """Counts in 32 bits wrap, and sums in float stand still, before 1e9 samples."""
    _billion(rig, alpha, BILLION)


@checks.one("accumulation/still-mean", kernels="long-runs")
def still_mean(rig: Rig, alpha: float) -> None:
    """Where all scores are nearly 1, the share of one is less than the last bit of the mean."""
    medium = {"homogeneous": {"sigma_t": 1e-5}}
    flight = rig.flight(tracker="ratio", medium=medium, rays=UPWARD, tightness=1e4, lanes=16)
    moments = flight.run(2047, 64).moments
    taken = (1.0 - moments.mean).mean()
    error = np.sqrt((moments.variance / moments.count).sum()) / len(moments.mean)
    text = f"takes {taken:.6g}, expected 1e-05"
    demand(abs(taken + np.expm1(-1e-5)) < stats.norm.isf(alpha / 2) * error + 2.0**-25, text)


@checks.one("long-runs/far-numbers", kernels="long-runs")
def far_numbers(rig: Rig, alpha: float) -> None:
    """A sample number that is cut to 31 or 32 bits repeats the run's beginning."""
    # From 2^31, 2^32 and 2^40 on: other samples, of the same distribution.
    medium = {"homogeneous": {"sigma_t": 1.0}}
    flight = rig.flight(tracker="delta", medium=medium, rays=UPWARD, lanes=16)
    usual = flight.record(1024).t
    for first in (2**31 - 512, 2**32 - 512, 2**40):
        samples = flight.record(1024, first_sample=first)
        check_clean(samples.round, bounded=True)
        same = np.mean(samples.t == usual)
        demand(same < 0.3, f"{same:.2g} of the samples from {first} on were there before")
        error = np.sqrt(samples.score.var() / samples.score.size)
        p_value = 2.0 * stats.norm.sf(abs(samples.score.mean() - np.exp(-1.0)) / error)
        require(np.array([p_value]), alpha / 3, f"mean from sample {first} on")


@checks.one("long-runs/blocks", kernels="long-runs")
def blocks(rig: Rig, alpha: float) -> None:
    """Samples that are numbered within their block or launch repeat those of others."""
    # Samples are the same however they are blocked and cut into launches.
    flight = rig.flight(tracker="delta", medium="trilinear", majorant="grid", lanes=16)
    one = flight.record(256)
    for other in (flight.record(64, blocks=4), flight.record(256, launches=7)):
        lookups = one.lookups, other.lookups
        check_same_samples(one.score, other.score, lookups, flight.rounding)


@checks.one("long-runs/cut-launches", labels=("slow",), kernels="long-runs")
def cut_launches(rig: Rig, alpha: float) -> None:
    """A launch of seconds is killed by watchdogs and cannot be cancelled."""
    # A run of a second or two: no launch of it takes so long, and none of its samples is lost.
    medium = {"homogeneous": {"sigma_t": 1.0}}
    flight = rig.flight(
        tracker="ratio", medium=medium, rays=UPWARD, tightness=1000, lanes=16, record=False
    )
    runner, seconds = flight.runner, []
    launch = runner.program.launch

    def watched(*arguments: object) -> float:
        took = launch(*arguments)
        seconds.append(took)
        return took

    runner.program.launch = watched  # type: ignore[method-assign]
    try:
        done, blocks = 0, 64
        while sum(seconds) < 1.5 and len(seconds) < 64 and done < 16:
            one = flight.run(64, blocks, first_sample=done * 2**20)
            demand(one.samples == 16 * 64 * blocks, f"{one.samples} samples, expected others")
            done, blocks = done + 1, min(2 * blocks, 1024)
    finally:
        del runner.program.launch  # type: ignore[method-assign]
    demand(max(seconds) < 1.0, f"a launch took {max(seconds):.2f} s of {sum(seconds):.2f} s")


@checks.one("accumulation/nonfinite", kernels="long-runs")
def nonfinite(rig: Rig, alpha: float) -> None:
    """A score that is infinite or no number, if it is dropped or not counted, leaves a mean that
    looks like an answer."""
    # Weights that overflow in two collisions, and then may be multiplied by 0.
    far_above = 2.0**83  # times its inverse it is a majorant of 1, exactly
    layers = {"breakpoints": [1.5], "values": [far_above, 1.0], "size": [1.0, 1.0, 3.0]}
    axes = {"medium": {"layered": layers}, "rays": {"orthographic": {"resolution": [8, 8]}}}
    for lanes in (1, 16):
        flight = rig.flight(tracker="ratio", tightness=1 / far_above, lanes=lanes, **axes)
        with np.errstate(invalid="ignore"):
            samples = flight.record(256)
        kinds = [np.count_nonzero(test(samples.score)) for test in (np.isinf, np.isnan)]
        demand(min(kinds) > 0, f"{kinds} scores are infinite, no number: expected some of both")
        counted, known = samples.round.counters["nonfinite"], sum(kinds)
        demand(counted == known, f"{counted} counted of {known} scores that are not finite")
        finite = np.isfinite(samples.round.moments.mean) & ~np.isfinite(samples.score).all(axis=1)
        demand(not finite.any(), "scores that are not finite are left out of a mean")


Make = Callable[[Path], str]
"""Writes a bad file; returns what the message must have beside its name."""


def refused(rig: Rig, alpha: float, make: Make, name: str) -> None:
    """A volume that is not what it should be becomes an answer that looks like one: it is refused,
    with its file, and the first voxel and count where values are wrong."""
    suffix = name.rpartition("-in-")[2] if "-in-" in name else "npy"
    path = rig.folder / f"{name}.{'tif' if name == 'not-an-image' else suffix}"
    wanted = make(path)
    medium = {"volume": {"file": str(path), "voxel_size": 0.25}}
    try:
        rig.flight(tracker="delta", medium=medium, lanes=1)
    except VolumeError as error:
        text = str(error)
        demand(path.name in text, f"the message does not name the file: {text}")
        demand(wanted in text, f"the message lacks '{wanted}': {text}")
        return
    raise Failure("the volume was taken for a good one")


def _save_slices(path: Path, values: np.ndarray) -> None:
    """Write an image with a slice along z in each of its parts or pages."""
    oiio = imported("OpenImageIO", path.name)

    specs = [oiio.ImageSpec(*values.shape[:0:-1], 1, oiio.FLOAT) for _ in values]
    for number, spec in enumerate(specs):
        spec.attribute("oiio:subimagename", f"slice {number}")
    output = oiio.ImageOutput.create(str(path))
    many = output.supports("multiimage") and path.suffix == ".exr"
    done = output.open(str(path), specs if many else specs[0])
    for number, plane in enumerate(values):
        if number:
            done = done and output.open(str(path), specs[number], "AppendSubimage")
        done = done and output.write_image(plane[..., None])
    demand(done and output.close(), f"{path.name} cannot be written: {output.geterror()}")


def _wrong_value(value: float, kind: str, save: Callable = np.save) -> Make:
    def make(path: Path) -> str:
        values = np.ones((4, 4, 4), np.float32)
        values[1, 2, 3] = values[3, 3, 3] = value
        save(path, values)
        return f"2 {kind} (first [z, y, x] = [1, 2, 3]: {value:g})"

    return make


def _saved(values: np.ndarray) -> Make:
    def make(path: Path) -> str:
        np.save(path, values)
        return ""

    return make


def _bytes(content: bytes) -> Make:
    def make(path: Path) -> str:
        path.write_bytes(content)
        return ""

    return make


def _truncated(path: Path) -> str:
    np.save(path, np.ones((4, 4, 4), np.float32))
    path.write_bytes(path.read_bytes()[:-64])
    return ""


BAD: dict[str, Make] = {
    "nan": _wrong_value(np.nan, "NaN"),
    "infinite": _wrong_value(np.inf, "infinite"),
    "negative": _wrong_value(-1.0, "negative"),
    "nan-in-exr": _wrong_value(np.nan, "NaN", _save_slices),
    "negative-in-exr": _wrong_value(-0.25, "negative", _save_slices),
    "infinite-in-tif": _wrong_value(-np.inf, "infinite", _save_slices),
    "two-axes": _saved(np.ones((4, 4), np.float32)),
    "no-voxels": _saved(np.ones((4, 0, 4), np.float32)),
    "text": _saved(np.full((2, 2, 2), "x")),
    "truncated": _truncated,
    "empty-file": _bytes(b""),
    "not-a-file-of-numpy": _bytes(b"\x93NUMPY" + struct.pack("<BBH", 9, 9, 4) + b"nope"),
    "not-an-image": _bytes(b"II*\x00 and nothing that follows"),
}
for name, make in BAD.items():
    options = {"labels": ("fast", TINY), "kernels": "bad-input", "make": make, "name": name}
    checks.one(f"bad-input/{name}", **options)(refused)
