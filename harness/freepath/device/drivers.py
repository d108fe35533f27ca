"""The OpenCL drivers that are known, and a view of one of them alone.

What one of them needs (a folder of .icd files, variables, a command in front) would hide or
disturb the others, and two builds of LLVM do not get on in one process. A process therefore sees
one driver: `enter` makes it so for this process, `in_process_of` for another one.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

from freepath.device.icd import in_icd_files, in_package, strangers

CHOSEN = "FREEPATH_DRIVER"
"""The variable that says which driver a process is for."""
STEERING = ("OCL_ICD_", "OPENCL_VENDOR_PATH", "RUSTICL_", "OCLGRIND_", "LD_PRELOAD")
"""Variables of the user that would bring other drivers into a process."""
INTEL = "libintelocl.so"
INTERPRETER_LOG = "OCLGRIND_LOG"


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


@dataclass(frozen=True)
class Driver:
    """A driver: how to see that it is there, how to get it, and what its process needs."""

    name: str
    """What -d takes."""
    title: str
    platform: str
    """How the name of its platform begins."""
    get: tuple[str, ...]
    """Commands that install it: those of apt need root."""
    find: Callable[[], str]
    """What was found of it; '' where it is not installed."""
    icd: bool = False
    """Whether what is found is a library that an .icd file must name."""
    distribution: bool | None = None
    """Of two drivers with the same platform: whether this is the one that Debian built."""
    variables: Mapping[str, str] = field(default_factory=dict, hash=False)
    prefix: tuple[str, ...] = ()
    """A command to put in front."""

    @property
    def missing(self) -> str:
        """What is missing and how to get it; '' where it is installed."""
        return "" if self.find() else f"not installed; `make devices`, or `{' && '.join(self.get)}`"

    def owns(self, platform: str, version: str) -> bool:
        """Tell whether a device is this driver's, by its platform and driver version."""
        built_by_debian = "debian" in version.lower()
        return platform.startswith(self.platform) and self.distribution in (None, built_by_debian)


def _apt(package: str) -> tuple[str, ...]:
    return (f"apt-get install {package}",)


POCL = "Portable Computing Language"
OTHERS = Driver(
    "others", "what else the system has", "", (), lambda: "others" if strangers() else ""
)
"""Devices of no known driver, such as GPUs, as the environment has them."""
DRIVERS = (
    Driver(
        "pocl-wheel",
        "PoCL from its PyPI wheel",
        POCL,
        ("pip install pocl-binary-distribution",),
        lambda: _version("pocl-binary-distribution"),
        distribution=False,
    ),
    Driver(
        "pocl-debian",
        "PoCL from Debian",
        POCL,
        _apt("pocl-opencl-icd"),
        lambda: in_icd_files("libpocl"),
        icd=True,
        distribution=True,
    ),
    Driver(
        "intel",
        "Intel's CPU runtime",
        "Intel(R) OpenCL",
        ("pip install intel-opencl-rt intel-cmplr-lib-rt",),
        lambda: in_package("intel-opencl-rt", INTEL) or in_icd_files(INTEL),
        icd=True,
    ),
    Driver(
        "rusticl",
        "Mesa's rusticl on llvmpipe",
        "rusticl",
        _apt("mesa-opencl-icd"),
        lambda: in_icd_files("libRusticlOpenCL"),
        icd=True,
        variables={"RUSTICL_ENABLE": "llvmpipe"},
    ),
    Driver(
        "oclgrind",
        "Oclgrind, which checks every access",
        "Oclgrind",
        _apt("oclgrind"),
        lambda: shutil.which("oclgrind") or "",
        prefix=("oclgrind", "--uninitialized", "--data-races"),
    ),
)
TimeoutExpired = subprocess.TimeoutExpired
BY_NAME = {driver.name: driver for driver in (*DRIVERS, OTHERS)}
LAST = ("rusticl", "oclgrind")
"""Chosen after what else the system has: one is slow, the other an interpreter."""
_entered: list[Driver] = []


def in_order() -> list[Driver]:
    """All drivers in the order in which they are chosen."""
    first = [driver for driver in DRIVERS if driver.name not in LAST]
    return [*first, OTHERS, *(driver for driver in DRIVERS if driver.name in LAST)]


def installed() -> list[Driver]:
    """The drivers that are there, in the order in which they are chosen."""
    return [driver for driver in in_order() if driver.find()]


def chosen_by_parent() -> Driver | None:
    """The driver of this process if `in_process_of` started it.

    A name that is not known is taken for none: nobody but `in_process_of` sets it.
    """
    return BY_NAME.get(os.environ.get(CHOSEN, ""))


def current() -> Driver | None:
    """The driver that this process sees; None where it sees whatever the environment has."""
    return chosen_by_parent() or (_entered[0] if _entered else None)


def owner(platform: str, version: str) -> Driver:
    """The installed driver of a device, or OTHERS."""
    there = (driver for driver in DRIVERS if driver.find())
    return next((driver for driver in there if driver.owns(platform, version)), OTHERS)


def is_in_view(platform: str, version: str) -> bool:
    """Tell whether this process is to see a device: all, or those of its driver."""
    driver = current()
    if driver is None:
        return True
    if driver is OTHERS:
        return owner(platform, version) is OTHERS
    return driver.owns(platform, version)


def environment_of(driver: Driver, folder: Path) -> dict[str, str]:
    """The variables of a driver's process; its .icd file is written into a folder."""
    if driver is OTHERS:
        return {**os.environ, CHOSEN: driver.name}
    kept = {name: text for name, text in os.environ.items() if not name.startswith(STEERING)}
    # PoCL's wheel is found by pyopencl without an .icd file, whatever this folder holds
    vendors = folder / "vendors"
    vendors.mkdir(exist_ok=True)
    if driver.icd:
        (vendors / f"{driver.name}.icd").write_text(f"{driver.find()}\n", encoding="utf-8")
    own = {CHOSEN: driver.name, "OCL_ICD_VENDORS": str(vendors), **driver.variables}
    if driver.prefix:
        own[INTERPRETER_LOG] = str(folder / "log")
    return kept | own


def enter(driver: Driver, initialise: Callable[[], object]) -> bool:
    """Let this process see one driver alone from now on; False where it cannot.

    The loader of OpenCL reads the environment once, when `initialise` asks it for platforms. What
    is set for it is taken back then, so that processes started later are not for this driver.
    """
    if current() or driver.prefix:
        return current() is driver
    before = dict(os.environ)
    with tempfile.TemporaryDirectory(prefix="freepath-") as folder:
        wanted = environment_of(driver, Path(folder))
        wanted.pop(CHOSEN)
        try:
            _become(wanted)
            initialise()
        finally:
            _become(before)
    _entered.append(driver)
    return True


def _become(environment: Mapping[str, str]) -> None:
    for name in os.environ.keys() - environment.keys():
        del os.environ[name]
    os.environ.update(environment)


@contextmanager
def started(
    driver: Driver, words: Sequence[str], **options: Any
) -> Iterator[subprocess.Popen[str]]:
    """Start a module of Python with its arguments where only this driver is seen.

    With options of subprocess.Popen. It is killed where it is left before it ends.
    """
    command = [*driver.prefix, sys.executable, "-m", *words]
    sys.stdout.flush()
    with (
        tempfile.TemporaryDirectory(prefix="freepath-") as folder,
        subprocess.Popen(
            command,
            env=environment_of(driver, Path(folder)),
            # Ctrl-C of a terminal would reach it twice: from there, and from here
            start_new_session=True,
            **options,
        ) as process,
    ):
        try:
            yield process
        finally:
            if process.poll() is None:
                # with what it has started: a command in front of Python ends later than Python
                os.killpg(process.pid, signal.SIGKILL)


def in_process_of(
    driver: Driver,
    arguments: Sequence[str],
    *,
    module: str = "freepath",
    capture: bool = False,
    timeout: float | None = None,
) -> subprocess.CompletedProcess[str]:
    """Run `freepath ARGUMENTS`, or another module of Python, where only this driver is seen.

    What it prints is passed through, or captured as stdout and stderr. An interruption of this
    process is handed on, and waits until the other has left everything in order. Raises
    subprocess.TimeoutExpired after that many seconds.
    """
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} if capture else {}
    with started(driver, [module, *arguments], text=True, errors="replace", **streams) as process:
        try:
            out, err = process.communicate(timeout=timeout)
        except KeyboardInterrupt:
            process.terminate()
            process.communicate()
            raise
    return subprocess.CompletedProcess(process.args, process.returncode, out, err)


def how_it_ended(code: int) -> str:
    """What to say of a process that failed; a crash of the driver ends it by a signal."""
    if code >= 0:
        return f"its process ended with exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return f"its process was ended by {name}"


class Complaints:
    """What an interpreter has found wrong with a kernel, from the log that it writes."""

    def __init__(self) -> None:
        self._path = os.environ.get(INTERPRETER_LOG, "")
        self._read = 0

    def new(self) -> str:
        """What was written since the last call."""
        if not self._path or not os.path.exists(self._path):
            return ""
        with open(self._path, encoding="utf-8", errors="replace") as file:
            file.seek(self._read)
            text = file.read()
            self._read = file.tell()
        return text.strip()


def report_lines(text: str) -> Iterator[str]:
    """The lines of a complaint that say something, in their order."""
    return (line.strip() for line in text.splitlines() if line.strip())
