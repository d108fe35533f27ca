"""The machine and the versions that a result came from."""

from __future__ import annotations

import contextlib
import os
import platform
import resource
from importlib import metadata
from pathlib import Path
from typing import Any

import psutil

from freepath import __version__

PACKAGES = ("numpy", "scipy", "pyopencl", "OpenImageIO", "tifffile", "pocl-binary-distribution")
VARIABLES = ("POCL_", "OCL_", "OPENCL_", "RUSTICL_", "PYOPENCL_", "CL_")


def processor() -> str:
    """The CPU's name, as the system gives it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [
                line.split(":", 1)[1].strip() for line in file if line.startswith("model name")
            ]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or platform.machine()


def load() -> float:
    """Runnable processes, averaged over a minute; above the number of cores timings suffer."""
    return round(psutil.getloadavg()[0], 2)


def memory_left() -> int:
    """Bytes that this process may still take, of the machine, its control group and its limit."""
    left = [psutil.virtual_memory().available]
    most, _ = resource.getrlimit(resource.RLIMIT_AS)
    if most != resource.RLIM_INFINITY:
        left.append(most - psutil.Process().memory_info().vms)
    with contextlib.suppress(OSError, ValueError):  # "max" is no number
        most, taken = (
            int(Path(f"/sys/fs/cgroup/memory.{name}").read_text()) for name in ("max", "current")
        )
        left.append(most - taken)
    return min(left)


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def packages() -> dict[str, str]:
    """The versions of the packages that results may depend on."""
    return {name: version for name in PACKAGES if (version := _version(name))}


def describe() -> dict[str, Any]:
    """Host and versions, fit for JSON."""
    return {
        "freepath": __version__,
        "python": platform.python_version(),
        "packages": packages(),
        "system": f"{platform.system()} {platform.release()}",
        "processor": processor(),
        "cores": os.cpu_count(),
        "memory_bytes": psutil.virtual_memory().total,
        "load_at_start": load(),
        "variables": {k: v for k, v in sorted(os.environ.items()) if k.startswith(VARIABLES)},
    }
