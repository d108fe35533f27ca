"""Shadow rays in an inner loop, and in lanes that have a mode: both composed, timed side by side.

`python tests/measure/shadow_rays.py DEVICE ROUNDS FOLDER` with the WDAS cloud's OpenVDB file in
the folder.
Of every scene: the time of a sample in modes over that in the inner loop with an interval of 95 %,
how far the estimates are apart, and which share of the lanes of all steps was live.
"""

import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from freepath.checks.rig import Rig
from freepath.compose import catalog
from freepath.compose import light_paths as effects
from freepath.compose.source import Source
from freepath.device.opencl import open_devices
from freepath.measure.runner import Runner
from freepath.measure.stats import Moments

ROUND_S = 0.15
RESAMPLED = 2000
LIGHT = {"point": {"position": [0.5, 0.5, 2], "intensity": 10}}
GRID = {"grid": {"resolution": 8}}
BALL = {"sigma_t": 10, "albedo": 0.5, "center": [0.5, 0.5, 0.5], "width": 0.2}
CLOUD = {"resolution": 64, "sigma_t": 50, "albedo": 0.9, "g": 0.5}
THIN = {"resolution": 32, "sigma_t": 8, "albedo": 0.9, "g": 0.7}
WDAS = {"file": "wdas_cloud_sixteenth.vdb", "sigma_t": 0.05, "albedo": 0.999, "g": 0.8}
HOMOGENEOUS = {"homogeneous": {"sigma_t": 4, "albedo": 0.5}}
SCENES = {
    "homogeneous": {"medium": HOMOGENEOUS, "tightness": 2},
    "homogeneous, grid majorant": {"medium": HOMOGENEOUS, "tightness": 2, "majorant": GRID},
    "gaussian": {"medium": {"gaussian": BALL}, "majorant": GRID},
    "procedural cloud, nearest": {
        "medium": {"cloud": CLOUD | {"interpolation": "nearest"}},
        "majorant": GRID,
    },
    "procedural cloud": {"medium": {"cloud": CLOUD}, "majorant": GRID},
    "procedural cloud, three channels": {
        "medium": {"cloud": CLOUD},
        "majorant": GRID,
        "effects": "all",
    },
    "thin cloud": {"medium": {"cloud": THIN}, "majorant": GRID, "scatterings": 8},
    "thin cloud, three channels": {
        "medium": {"cloud": THIN},
        "majorant": GRID,
        "scatterings": 8,
        "effects": "all",
    },
    "WDAS cloud": {
        "medium": {"volume": WDAS},
        "majorant": {"grid": {"resolution": [16, 11, 20]}},
        "light": {"point": {"position": [0, 600, 0], "intensity": 1e6}},
        "scatterings": 64,
    },
}
STEP = "    flight_step(path, scene, rng);\n    const mask ended"
MODES_STEP = "    path->live = flying;\n"
SHADOW_STEP = "        shadow_step(&shadow, scene, &shadow_rng);"
COUNT = "{0}->violations += 1; {0}->crossings -= {0}->live;"


@dataclass(frozen=True)
class Form:
    """A scene in one form: to be timed, and to count lanes and live lanes of each step."""

    timed: Runner
    counting: Runner

    def occupancy(self, samples: int, blocks: int) -> float:
        """The share of lanes that were live, over the steps of paths and of shadow rays."""
        counters = self.counting.run(0, samples, blocks).counters
        return counters["crossings"] / counters["violations"]


def counted(text: Source) -> Source:
    """With lanes and live lanes counted where a source without counting has nothing."""
    changed = text.text
    if MODES_STEP in changed:
        changed = changed.replace(MODES_STEP, MODES_STEP + COUNT.format("path"))
    else:
        changed = changed.replace(STEP, COUNT.format("path") + STEP)
        changed = changed.replace(SHADOW_STEP, f"{{ {COUNT.format('(&shadow)')} {SHADOW_STEP} }}")
    return Source(changed, text.options)


def form_of(rig: Rig, axes: dict, *, modes: bool) -> Form:
    """Compose and build a scene."""
    effects.modes_pay = lambda medium, channels: modes
    known = {"estimand": "radiance", "tracker": "delta", "shadow": "ratio", "scatterings": 16}
    rays = {"orthographic": {"resolution": 32, "direction": [0, 0, 1]}}
    axes = known | {"rays": rays, "light": LIGHT} | axes
    timed = rig.flight(count=False, record=False, **axes).runner
    text = timed.program.source
    assert ("shadow_mode.cl" in text.text) == modes
    return Form(timed, replace(timed, program=rig.program(counted(text))))


def side_by_side(forms: list[Form], rounds: int) -> tuple[np.ndarray, list[Moments], int]:
    """Times of a sample (rounds, forms) of rounds in random order, and all moments."""
    random, samples = np.random.default_rng(1), 4
    for form in forms:
        form.timed.run(0, samples)
    one = forms[0].timed.run(0, samples, 4)
    blocks = max(4, int(4 * ROUND_S / one.time_s))
    times, moments = np.empty((rounds, len(forms))), [None] * len(forms)
    for turn in range(rounds):
        for place in random.permutation(len(forms)):
            first = (place * rounds + turn) * samples * blocks
            one = forms[place].timed.run(first, samples, blocks)
            times[turn, place] = one.time_per_sample_s
            before = moments[place]
            moments[place] = before.merged(one.moments) if before else one.moments
    return times, moments, blocks


def interval(ratios: np.ndarray) -> np.ndarray:
    """The 95 % interval of the median, by the bootstrap."""
    drawn = np.random.default_rng(2).choice(ratios, (RESAMPLED, len(ratios)))
    return np.percentile(np.median(drawn, axis=1), [2.5, 97.5])


def apart(one: Moments, other: Moments) -> float:
    """The difference of two estimates in its standard errors."""
    errors = [(m.m2 / m.count**2).sum() for m in (one, other)]
    return (other.mean - one.mean).sum() / np.sqrt(sum(errors))


def main(device: str, rounds: int, folder: Path) -> None:
    """Print a row of a table for each scene."""
    opened = open_devices([device])[0]
    print(f"{opened.info.platform} {opened.info.driver_version}, {opened.info.lanes} lanes\n")
    print("| scene | inner loop, ns a sample | modes / inner loop | z | live: inner loop | modes |")
    print("| --- | --- | --- | --- | --- | --- |")
    WDAS["file"] = str(folder / WDAS["file"])
    with tempfile.TemporaryDirectory() as work:
        rig = Rig(opened, catalog.load(), Path(work))
        for name, axes in SCENES.items():
            forms = [form_of(rig, axes, modes=modes) for modes in (False, True)]
            times, moments, blocks = side_by_side(forms, rounds)
            ratios = times[:, 1] / times[:, 0]
            low, high = interval(ratios)
            inner, modes = (form.occupancy(4, blocks) for form in forms)
            ratio = f"{np.median(ratios):.3f} ({low:.3f} to {high:.3f})"
            time = f"{1e9 * np.median(times[:, 0]):.0f}"
            z = f"{apart(*moments):+.1f}"
            print(f"| {name} | {time} | {ratio} | {z} | {inner:.0%} | {modes:.0%} |", flush=True)


main(sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]))
