"""Voxels stored in half: every value of one, contrasts, and means of what is rounded."""

from __future__ import annotations

import numpy as np

from freepath.checks.cases import check_samples
from freepath.checks.parts import Lanes
from freepath.checks.rig import Rig
from freepath.checks.suite.common import VOXELS, Checks, everyone, knows_depth, voxels
from freepath.checks.suite.geometry import contrast
from freepath.checks.verdict import demand
from freepath.compose import kernel_files
from freepath.compose.catalog import Tracker

LARGEST, SMALLEST = 65504.0, 2.0**-24
INFINITE = 0x7C00
"""The bits of infinity: those of every positive finite half are below."""
DEEP = 2.0**20
"""Of a cube whose voxels have optical depths of some sixteenths, all are denormal halves."""


checks = Checks()


def in_voxels(tracker: Tracker) -> bool:
    """Trackers that fly through voxels."""
    return everyone(tracker) and not knows_depth(tracker)


def every_value(rig: Rig, alpha: float, lanes: int) -> None:
    """A helper that mixes up two of its lanes, or a conversion of one's own that loses the denormal
    halves, is seen in some shapes of a device alone: each shape reads, compares, picks and stores
    as one lane does, and all finite halves are the same float."""
    halves = np.arange(INFINITE, dtype=np.uint16)
    count = len(halves)
    place = np.random.default_rng(lanes).permutation(count).astype(np.uint32)
    single = halves.view(np.float16).astype(np.float32)
    part = Lanes(rig, lanes, more=kernel_files.read("media/storage_half").code)
    inputs = [halves.view(np.uint32), place, single.view(np.uint32)]
    found = np.array(part(BODY, inputs, ["real"] * 6 + ["bits"] * 3, count), float)[..., 0]
    other, third = single[place], place % 3 == 0
    alike = np.zeros(-(-count // lanes) * lanes, bool)
    alike[:count] = third
    groups = np.repeat(alike.reshape(-1, lanes).sum(axis=1), lanes)[:count]
    expected = {
        "gather_half": other,
        "gather": other,
        "choose": np.where(third, other, single),
        "smaller": np.minimum(other, single),
        "larger": np.maximum(other, single),
        "store_lanes and load_lanes": single,
        "lane_count and any_lane": 2 * groups + (groups > 0),
        "carry": place >= 2**14,
        "high_word": place.astype(np.uint64) * 0xD2511F53 >> 32,
    }
    for one, (name, right) in zip(found, expected.items(), strict=True):
        wrong = np.flatnonzero(one != right)
        first = [(hex(i), one[i], right[i]) for i in wrong[:1]]
        demand(not wrong.size, f"{name}: {wrong.size} of {count} are wrong, first {first}")


BODY = """
out0 = gather_half((__global const half *)in0_, as_index(in1));
out1 = gather((__global const float *)in2_, as_index(in1));
const mask third = equal(as_index(in1) % 3, (index)0);
const real mine = as_real(in2);
out2 = choose(third, out1, mine);
out3 = smaller(out1, mine);
out4 = larger(out1, mine);
float kept[LANES];
store_lanes(mine, kept);
out5 = load_lanes(kept);
out6 = (bits)(uint)(2 * lane_count(third) + any_lane(third));
const bits sum = (in1 << 17) + (bits)0x80000000u;
out7 = carry(sum, (bits)0x80000000u);
out8 = high_word(in1, 0xD2511F53u);
"""


@checks.hard("contrast/half-denormal", in_voxels)
def denormal(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """Densities that are denormal halves are ordinary numbers once they are read: flushed to 0 a
    thin and large medium vanishes."""
    # Multiples of the smallest half: nothing is rounded, so the mean is that of float.
    steps = np.ceil(16.0 * VOXELS)
    flight = voxels(rig, tracker, steps / 16.0, DEEP, storage="half")
    read = flight.stored.bounds((1, 1, 1))[1].max()
    demand(0.0 < read < 2.0**-14, f"the largest density is {read:.3g}, expected a denormal half")
    apart = np.abs(flight.stored.sigma_t(_CENTRES) - flight.medium.sigma_t(_CENTRES)).max()
    demand(apart == 0.0, f"densities that are halves are rounded by {apart:.3g}")
    check_samples(flight, flight.record(2048), alpha)


_CENTRES = np.argwhere(VOXELS >= 0.0)[:, ::-1] + 0.5


@checks.hard("contrast/half-rounded", in_voxels)
def rounded(rig: Rig, alpha: float, tracker: Tracker) -> None:
    """A density that is rounded up is above a majorant or control of the density as it was: these
    must be of what is stored, and the mean that of the rounded medium."""
    # Densities of which half are rounded up, beside empty ones, and each cell's own majorant.
    axes = {"storage": "half", "interpolation": "nearest"}
    flight = voxels(rig, tracker, VOXELS, **axes)
    upward = flight.stored.sigma_t(_CENTRES) - flight.medium.sigma_t(_CENTRES)
    demand((upward > 0.0).any() and (upward < 0.0).any(), "no density is rounded either way")
    flight = flight.as_stored()
    check_samples(flight, flight.record(2048), alpha)


HALVES = """Neighbours of 0, of the largest and of the smallest half are halves exactly: rays
through one must not see the other, and none is infinite."""
ENDS = {"ends": (LARGEST, SMALLEST), "storage": "half"}
checks.hard("contrast/half-million", in_voxels, sentence=HALVES, **ENDS)(contrast)
for lanes in (1, 2, 4, 8, 16):
    checks.one(f"contrast/half-values/{lanes}-lanes", lanes=lanes)(every_value)
