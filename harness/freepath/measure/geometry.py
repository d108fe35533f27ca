"""In how many work-items, and in groups of how many, a kernel runs fastest on a device.

On a CPU that is known. On other devices it depends on the kernel's registers and on how the device
hides the latency of memory, so it is tried. No sample depends on it.
"""

from __future__ import annotations

import math

from freepath.device.opencl import DeviceInfo, Program, WorkItems
from freepath.errors import RunError
from freepath.measure.rounds import Bench, shape_of

TRIAL_S = 0.02
"""Device time of a trial launch."""
LEAST_GROUP, MOST_GROUP = 32, 256
PER_UNIT = (256, 512, 1024, 2048)
"""Work-items for each compute unit: current GPUs hold up to 2048."""
FINALISTS = 4
"""So many geometries get a second trial."""


def is_open(info: DeviceInfo) -> bool:
    """Whether a device's geometry is to be tried out."""
    return info.kind != "CPU" and not info.interpreted and not info.loop_limit


def candidates(program: Program) -> list[WorkItems]:
    """Global and local sizes to try: what the user wants, or doublings of the preferred multiple.

    Groups have 32 to 256 work-items, as far as the kernel can be run in these.
    """
    device = program.device
    most = min(MOST_GROUP, program.told("WORK_GROUP_SIZE") or LEAST_GROUP)
    multiple = program.told("PREFERRED_WORK_GROUP_SIZE_MULTIPLE") or LEAST_GROUP
    first = multiple * math.ceil(LEAST_GROUP / multiple)
    groups = [first << doublings for doublings in range(8) if first << doublings <= most]
    if device.work_group or not groups:
        groups = [program.work_items[1]]
    units = device.info.compute_units
    sizes = [(units * max(1, n // group) * group, group) for group in groups for n in PER_UNIT]
    return list(dict.fromkeys(sizes))


def choose(bench: Bench) -> None:
    """Let the timed kernel run in the fastest geometry, from now on and in all of its cases.

    Raises RunError where none of them can be launched.
    """
    runner, program = bench.timed, bench.timed.program
    if program.calibrated:
        return
    found = candidates(program)
    one = bench.run_for(runner, TRIAL_S / 2)
    per_ray = int(TRIAL_S / one.time_per_sample_s / runner.rays)
    lanes = max(items for items, _ in found) * runner.lanes
    # the same work for all, so that the largest has enough of it
    shape = shape_of(per_ray, runner.rays, one.time_per_sample_s, lanes)
    seconds: dict[WorkItems, float] = {}
    refused: RunError | None = None
    for repeat in range(2):
        for items in sorted(seconds, key=seconds.__getitem__)[:FINALISTS] if repeat else found:
            try:
                took = bench.run(runner, 0, shape, work_items=items, launches=1).time_s
            except RunError as error:
                refused = error
            else:
                seconds[items] = min(took, seconds.get(items, math.inf))
    if not seconds:
        raise refused or RunError(f"{program.device.info.label}: no geometry to try")
    program.work_items = min(seconds, key=seconds.__getitem__)
    program.calibrated = True
