"""Whether a driver can compile and run a kernel here: tried once in a process of its own, and kept.

`python -m freepath.device.trial` is that process. It prints a line of JSON for each device, before
it builds anything on it and after: of a driver that crashes or hangs, the first still says which
devices there are. What became of it is kept in the cache, by all that it could depend on.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import signal
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from freepath.compose.source import Source
from freepath.device import cpu_name, drivers, environment, icd
from freepath.device.compilers import first_error
from freepath.device.drivers import Driver
from freepath.device.opencl import Device, DeviceInfo, all_devices
from freepath.errors import FreepathError
from freepath.scene.cache import cache_dir

TRIAL_S = 30.0
"""After this a driver that does not answer is given up."""
ITEMS = 8
NOTHING = "it lists no device"
KERNEL = """#line 1 "trial"
#if LANES == 1
typedef float real;
#define STORE(v, i, p) (p)[i] = (v)
#else
#define JOIN(a, b) a##b
#define EXPAND(a, b) JOIN(a, b)
typedef EXPAND(float, LANES) real;
#define STORE(v, i, p) EXPAND(vstore, LANES)(v, i, p)
#endif
__kernel void track(__global float *out, __global uint *taken)
{
    const uint item = get_global_id(0);
    const real x = (real)(item + 1.0f);
    STORE(log(x) + exp(-x) + sqrt(x) + native_sin(x), item, out);
    atomic_inc(taken);
}
"""


@dataclass(frozen=True)
class Outcome:
    """What a driver's trial showed."""

    devices: tuple[DeviceInfo, ...] = ()
    """Those that it lists."""
    failures: tuple[str, ...] = ()
    """For each of them why it cannot be used; '' where it can."""
    failure: str = ""
    """What became of its process, where that went wrong; why it lists no device."""
    doubtful: bool = False
    """Whether its time ran out on a busy machine: then it is tried again the next time."""

    @property
    def working(self) -> list[DeviceInfo]:
        """The devices on which a kernel was built and gave what it should."""
        return [info for info, why in zip(self.devices, self.failures, strict=True) if not why]

    @property
    def reason(self) -> str:
        """Why no device of it can be used; '' where one can."""
        if self.working:
            return ""
        return next(iter(filter(None, (*self.failures, self.failure))), NOTHING)


def of_installed(*, afresh: bool = False) -> dict[Driver, Outcome]:
    """What the trials of all drivers showed that are there; what else the system has, if it has."""
    there = drivers.installed()
    tried = dict(zip(there, outcomes(there, afresh=afresh), strict=True))
    if drivers.OTHERS in tried and tried[drivers.OTHERS].failure.startswith(NOTHING):
        del tried[drivers.OTHERS]
    return tried


def outcomes(wanted: Sequence[Driver], *, afresh: bool = False) -> list[Outcome]:
    """What the trial of each driver showed, from the cache unless it is to be made afresh."""
    kept = {} if afresh else _kept()
    keys = [_key(driver) for driver in wanted]
    missing = [driver for driver, key in zip(wanted, keys, strict=True) if key not in kept]
    with ThreadPoolExecutor() as pool:
        fresh = dict(zip(missing, pool.map(_tried, missing), strict=True))
    if fresh:
        known = dict(zip(wanted, keys, strict=True))
        certain = {driver: one for driver, one in fresh.items() if not one.doubtful}
        _keep({known[driver]: dataclasses.asdict(one) for driver, one in certain.items()})
    return [fresh.get(d) or _outcome(kept[key]) for d, key in zip(wanted, keys, strict=True)]


def _tried(driver: Driver) -> Outcome:
    """Run the trial of a driver in its process; what it could say before it ended counts."""
    why, doubtful = "", False
    try:
        ended = drivers.in_process_of(
            driver, [], module="freepath.device.trial", capture=True, timeout=TRIAL_S
        )
        out, said = ended.stdout, ended.stderr
        if ended.returncode:
            why = drivers.how_it_ended(ended.returncode)
    except drivers.TimeoutExpired as error:
        out, said = (
            (text or b"").decode("utf-8", "replace") for text in (error.stdout, error.stderr)
        )
        why = f"it did not build and run a kernel within {TRIAL_S:g} s and was stopped"
        doubtful = environment.load() > (os.cpu_count() or 1)
    except OSError as error:
        out, said, why = "", "", str(error)
    records: dict[str, dict[str, Any]] = {}
    for line in out.splitlines():
        if line.startswith("{"):
            record = json.loads(line)
            records[record["info"]["name"]] = record
    infos = tuple(DeviceInfo(**record["info"]) for record in records.values())
    unfinished = why or "its trial ended without a word"
    failures = tuple(record.get("failure", unfinished) for record in records.values())
    if not infos:
        last = (said.strip().splitlines() or [""])[-1]
        why = "; ".join(filter(None, (why or NOTHING, _cache_folder(), last)))
    return Outcome(infos, failures, why, doubtful)


def _cache_folder() -> str:
    """What to say of PoCL's cache folder, without which it lists no device."""
    chosen = os.environ.get("POCL_CACHE_DIR")
    if not chosen:
        return ""
    try:
        Path(chosen).mkdir(parents=True, exist_ok=True)
        if os.access(chosen, os.W_OK):
            return ""
        error = "it cannot be written"
    except OSError as problem:
        error = problem.strerror or str(problem)
    return f"the cache folder {chosen} of POCL_CACHE_DIR cannot be made: {error}"


def _key(driver: Driver) -> str:
    """Names all that the outcome of a driver's trial may depend on."""
    found = driver.find()
    icds = {str(file): name for file, name in icd.icd_files().items()}
    libraries = [Path(found), *(folder / found for folder in icd.LIBRARIES)]
    files = [f"{p} {p.stat().st_size} {p.stat().st_mtime_ns}" for p in libraries if p.is_file()]
    steering = ("POCL_", "PYTHONPATH", "XDG_CACHE_HOME", "HOME", *drivers.STEERING)
    variables = {k: v for k, v in sorted(os.environ.items()) if k.startswith(steering)}
    cpu = (environment.processor(), sorted(cpu_name.cpu_flags()))
    code = [
        Path(module.__file__).read_text("utf-8") for module in (cpu_name, sys.modules[__name__])
    ]
    others = icds if driver is drivers.OTHERS else {}
    text = json.dumps([driver.name, driver.prefix, found, files, others, variables, cpu, code])
    return hashlib.sha256(f"{text}{environment.packages()}{sys.prefix}".encode()).hexdigest()


def cache_file() -> Path:
    """Where outcomes are kept."""
    return cache_dir() / "drivers.json"


def _kept() -> dict[str, Any]:
    try:
        found = json.loads(cache_file().read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _keep(fresh: dict[str, Any]) -> None:
    """Add outcomes to the cache; one that cannot be written is done without."""
    file = cache_file()
    part = file.with_name(f"{file.name}.{os.getpid()}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(json.dumps({**_kept(), **fresh}), "utf-8")
        part.replace(file)
    except OSError:
        part.unlink(missing_ok=True)


def _outcome(record: dict[str, Any]) -> Outcome:
    infos = tuple(DeviceInfo(**info) for info in record["devices"])
    return Outcome(infos, tuple(record["failures"]), record["failure"])


def try_device(device: Device) -> str:
    """Build and run a kernel like those of trackers; returns what was wrong, or ''."""
    lanes = device.info.lanes
    try:
        program = device.build(Source(KERNEL, (f"-DLANES={lanes}",)))
        out, taken = device.allocate(4 * ITEMS * lanes), device.allocate(4)
        device.write(taken, np.zeros(1, np.uint32))
        program.launch([out, taken], ITEMS, 1)
    except FreepathError as error:
        return first_error(error)
    found = device.read(out, (ITEMS, lanes), np.float32)
    x = np.arange(1.0, ITEMS + 1.0)[:, None]
    wanted = np.log(x) + np.exp(-x) + np.sqrt(x) + np.sin(x)
    if not np.allclose(found, wanted, rtol=1e-3, atol=1e-3):
        return f"a kernel gave {found.ravel()[0]:g} where {wanted[0, 0]:g} is right"
    count = int(device.read(taken, (1,), np.uint32)[0])
    return "" if count == ITEMS else f"an atomic counter came to {count} instead of {ITEMS}"


def main() -> int:
    """Try each device of this process's driver, a line of JSON before and after."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for device, info in all_devices():
        record: dict[str, Any] = {"info": dataclasses.asdict(info)}
        print(f"\n{json.dumps(record)}", flush=True)
        try:
            record["failure"] = try_device(Device(device, info))
        except FreepathError as error:
            record["failure"] = first_error(error)
        print(f"\n{json.dumps(record)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
