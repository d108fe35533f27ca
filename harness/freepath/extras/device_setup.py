"""Installs the OpenCL drivers that need no special hardware: `python -m
freepath.extras.device_setup`.

What cannot be installed is said, with the reason, and the others still are. Nothing has to be set
up beyond that: `drivers.environment_of` writes what each of them needs when it is used.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys

from freepath.device import drivers, selection, trial
from freepath.device.drivers import Driver
from freepath.errors import FAILED, DeviceError
from freepath.show import listing

INSTALL_S = 1800.0
"""An installation that takes longer is given up."""


def command_of(text: str) -> list[str]:
    """What a driver's command is to be run as: pip of this Python, and apt asking nothing."""
    program, *words = shlex.split(text)
    if program == "pip":
        return [sys.executable, "-m", "pip", *words, "--quiet", "--disable-pip-version-check"]
    return [program, *words[:1], "-y", "-qq", *words[1:]]


def obstacle(text: str) -> str:
    """Why a command cannot even be tried; '' where it can."""
    program = shlex.split(text)[0]
    if program == "pip":
        return ""
    if not shutil.which(program):
        return f"there is no {program} here"
    return "" if os.geteuid() == 0 else f"{program} needs root"


def run(command: list[str]) -> str:
    """Run a command; returns what went wrong, or ''."""
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    try:
        ended = subprocess.run(
            command,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=INSTALL_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    if ended.returncode == 0:
        return ""
    lines = [line.strip() for line in (ended.stdout + ended.stderr).splitlines() if line.strip()]
    telling = [line for line in lines if line.lower().startswith(("e:", "error"))] or lines[-1:]
    return (telling or [f"exit code {ended.returncode}"])[0]


def install(driver: Driver) -> str:
    """Install a driver that is missing; returns why that failed, or ''."""
    for text in driver.get:
        problem = obstacle(text) or run(command_of(text))
        if problem:
            return f"`{text}`: {problem}"
    return "" if not driver.missing else "was installed and is still not found"


def install_if_needed() -> int:
    """Install Intel's runtime where no driver works; returns the exit code."""
    try:
        selection.default()
    except DeviceError as error:
        intel = drivers.BY_NAME["intel"]
        print(
            f"{error}\ninstalling {intel.title} instead: 270 MB, under Intel's licence", flush=True
        )
        problem = install(intel)
        if problem:
            print(f"MISSING: {problem}", file=sys.stderr)
            return FAILED
    return 0


def main() -> int:
    """Install what is missing, say what each driver is now; 8 where one is missing or broken."""
    if sys.argv[1:] == ["--if-needed"]:
        return install_if_needed()
    missing = [driver for driver in drivers.DRIVERS if driver.missing]
    by_apt = any(text.startswith("apt-get") for driver in missing for text in driver.get)
    if by_apt and not obstacle("apt-get update"):
        run(["apt-get", "update", "-qq"])  # what fails here fails with its reason below
    problems = {driver: install(driver) for driver in missing}
    there = [driver for driver in drivers.DRIVERS if driver.find()]
    tried = dict(zip(there, trial.outcomes(there, afresh=True), strict=True))
    for driver in drivers.DRIVERS:
        outcome = tried.get(driver)
        if outcome and outcome.working:
            info = outcome.working[0]
            remarks = "".join(f"; {remark}" for remark in listing.remarks(info))
            print(f"{driver.name:12} {info.label}{remarks}")
        else:
            reason = problems.get(driver) or (outcome.reason if outcome else "not installed")
            print(f"{driver.name:12} MISSING: {reason}", file=sys.stderr)
    return 0 if all(d in tried and tried[d].working for d in drivers.DRIVERS) else FAILED


if __name__ == "__main__":
    sys.exit(main())
