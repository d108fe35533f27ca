"""Which devices -d means, and the process that each must be run in."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from freepath import drivers
from freepath.device import DeviceInfo, list_devices, matches
from freepath.drivers import OTHERS, Driver
from freepath.errors import DeviceError, FreepathError

Parts = list[tuple[Driver, list[str]]]
PROBE_S = 60.0
"""After this a driver that should list its devices is taken for broken."""


def processes_of(selectors: Sequence[str]) -> Parts:
    """The drivers that -d means, each with what selects among its devices; [] if here will do.

    Here will do without a selector, in a process that is a driver's own, and if what is selected
    can all be seen. The name of a driver means that driver, 'all' every device that there is.
    Raises DeviceError for one that is not installed or not there.
    """
    if drivers.current() or not selectors:
        return []
    here = list_devices()
    found: dict[Driver, list[str]] = {}
    elsewhere = False
    for selector in (" ".join(text.lower().split()) for text in selectors):
        wanted, outside = _meant(selector, here)
        elsewhere |= outside
        for driver in wanted:
            found.setdefault(driver, []).append("all" if outside else selector)
    return list(found.items()) if elsewhere else []


def _meant(selector: str, here: list[DeviceInfo]) -> tuple[list[Driver], bool]:
    """The drivers of one selector, and whether it can only be had in their processes."""
    if selector == "all":
        return everywhere(here), True
    if selector in drivers.BY_NAME:
        driver = drivers.BY_NAME[selector]
        if driver.missing:
            raise DeviceError(f"{driver.name}: {driver.missing}")
        return [driver], True
    matching = [info for info in here if matches(info, selector)]
    if matching:
        return _owners(matching), False
    hidden = [driver for driver in drivers.installed() if driver not in _owners(here)]
    probed = dict(zip(hidden, probe(hidden), strict=True))
    wanted = [d for d, infos in probed.items() if any(matches(info, selector) for info in infos)]
    if not wanted:
        known = [info.label for infos in (here, *probed.values()) for info in infos]
        known += [
            f"{driver.name}: {driver.missing}" for driver in drivers.DRIVERS if driver.missing
        ]
        names = "\n".join(f"  {name}" for name in known)
        raise DeviceError(f"no OpenCL device matches '{selector}'; there are\n{names}")
    return wanted, True


def planned(parts: Parts) -> list[list[DeviceInfo]]:
    """The devices that each part means, as its process sees them; none of one that crashes.

    Raises DeviceError where two drivers have a device of the same name on platforms of the same
    name: rows are known by these, and those of one would take the place of the other's.
    """
    probed = probe([driver for driver, _ in parts])
    found = [
        [info for info in infos if any(matches(info, one) for one in selectors)]
        for (_, selectors), infos in zip(parts, probed, strict=True)
    ]
    owners: dict[tuple[str, str], tuple[Driver, DeviceInfo]] = {}
    for (driver, _), infos in zip(parts, found, strict=True):
        for info in infos:
            other, known = owners.setdefault((info.name, info.platform), (driver, info))
            if other is not driver:
                raise DeviceError(
                    f"{other.name} and {driver.name} differ by the driver's version alone, and a "
                    f"result tells devices apart by name and platform: {known.label}, {info.label}"
                    "; run each into a folder of its own"
                )
    return found


def everywhere(here: list[DeviceInfo]) -> list[Driver]:
    """All drivers that are installed, and OTHERS if the system has devices of no known one."""
    others = [OTHERS] if OTHERS in _owners(here) else []
    return [*drivers.installed(), *others]


def _owners(infos: Iterable[DeviceInfo]) -> list[Driver]:
    """The drivers of devices, each once."""
    return list(dict.fromkeys(drivers.owner(info.platform, info.driver_version) for info in infos))


def probe(wanted: Sequence[Driver]) -> list[list[DeviceInfo]]:
    """The devices of each driver, as its own process sees them; none of one that crashes."""
    with ThreadPoolExecutor() as pool:
        return list(pool.map(_devices_of, wanted))


def _devices_of(driver: Driver) -> list[DeviceInfo]:
    try:
        ended = drivers.in_process_of(driver, ["devices", "--json"], capture=True, timeout=PROBE_S)
        records: list[dict[str, Any]] = json.loads(ended.stdout) if ended.returncode == 0 else []
    except (OSError, ValueError, FreepathError, drivers.TimeoutExpired):
        return []
    return [DeviceInfo(**record) for record in records]
