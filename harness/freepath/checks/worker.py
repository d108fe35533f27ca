"""Runs checks one after the other in a process of its own, which may crash or hang."""

from __future__ import annotations

import os
import time
import traceback
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from freepath.checks import registry
from freepath.checks.model import LEVEL, Check
from freepath.checks.outcome import FAILED, PASSED, SKIPPED
from freepath.checks.rig import SEED, Rig
from freepath.checks.verdict import Failure, NotApplicable, chance_of_smallest, hearing
from freepath.compose import catalog
from freepath.device import drivers
from freepath.device.drivers import INTERPRETER_LOG
from freepath.device.opencl import list_devices, open_devices
from freepath.device.selection import one_device
from freepath.errors import DriverLimitError, FreepathError, MissingPackageError
from freepath.scene.cache import reading_only

STRIDE = 1_000_003
"""Between the seeds of repeats: more than the checks add to them."""


@dataclass(frozen=True)
class Setting:
    """What a worker needs to know: which device, which trackers, which seed."""

    device: str | None = None
    """A selector, or None for the first."""
    driver: str = ""
    """What the process is to see; '' where that is to be found out."""
    trackers: Sequence[Path] = ()
    seed: int = SEED
    arithmetic: str = "strict"
    """Of kernels, where a check does not say."""
    storage: str = "float"
    """Of voxels, where a check does not say."""

    def seed_of(self, repeat: int) -> int:
        """Of a repeat, counted from 0."""
        return self.seed + STRIDE * repeat


def serve(connection: Connection, setting: Setting, folder: Path) -> None:
    """Answer each (check's name, repeat) with what `run` returns until there are no more.

    The first message is '' or why the device cannot be used. The folder is for what checks write.
    """
    # every process of an interpreter begins its log anew
    os.environ[INTERPRETER_LOG] = str(folder / "log")
    try:
        known = catalog.load(setting.trackers)
        if setting.driver:
            drivers.enter(drivers.BY_NAME[setting.driver], list_devices)
            device = open_devices([setting.device])[0]
        else:
            device = one_device([setting.device] if setting.device else [])
        rig = Rig(device, known, folder, setting.seed)
        rig = rig.with_arithmetic(setting.arithmetic).with_storage(setting.storage)
    except FreepathError as error:
        connection.send(str(error))
        return
    checks = {check.name: check for check in registry.checks(known)}
    connection.send("")
    while (task := connection.recv()) is not None:
        name, repeat = task
        seeded = rig.with_seed(setting.seed_of(repeat))
        # references of rays that are drawn once would fill the user's cache
        with reading_only() if repeat else nullcontext():
            answer = run(seeded, checks[name])
        connection.send(answer)


def run(rig: Rig, check: Check) -> tuple[str, float, str, float | None]:
    """Run a check; returns its status, how many seconds it took, what it has to say, its p-value.

    The p-value is the chance of the smallest that its tests found, as of an `Outcome`.
    """
    started = time.perf_counter()
    with hearing() as heard:
        status, text = _verdict(rig, check)
    p_value = chance_of_smallest(np.array(heard)) if heard else None
    return status, time.perf_counter() - started, text, p_value


def _verdict(rig: Rig, check: Check) -> tuple[str, str]:
    reason = check.reason_against(rig.device.info)
    if reason:
        return SKIPPED, reason
    try:
        check.run(rig, LEVEL)
    except (NotApplicable, MissingPackageError) as error:
        return SKIPPED, str(error)
    except DriverLimitError as error:
        # of a driver without limits it is a fault, whosever it is
        return SKIPPED if rig.device.info.loop_limit else FAILED, str(error)
    except (Failure, FreepathError) as error:
        return FAILED, str(error)
    except Exception:
        return FAILED, traceback.format_exc()
    return PASSED, ""
