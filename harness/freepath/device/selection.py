"""What -d means: the drivers and devices that are used, chosen by what works here."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import NamedTuple

from freepath.device import drivers
from freepath.device.drivers import Driver
from freepath.device.opencl import Device, DeviceInfo, list_devices, matches, open_devices
from freepath.device.trial import NOTHING, Outcome, of_installed, outcomes
from freepath.errors import DeviceError, RunError, did_you_mean

INSTALL = "`make devices` installs those that it can"
REMEDY = "choose another by -d (`freepath devices` tries them all)"


DEFAULT = "FREEPATH_DEVICE"
"""The variable that names the device where -d does not."""


class Part(NamedTuple):
    """A driver, the devices of it that are meant and work, and why others of it do not."""

    driver: Driver
    infos: list[DeviceInfo]
    failure: str = ""


Parts = list[Part]


def resolve(selectors: Sequence[str]) -> Parts:
    """The drivers and devices that -d means, in the order in which they are chosen.

    Without a selector what $FREEPATH_DEVICE names, else the first device that works. The name of a
    driver means its devices, 'all' every device that there is, any other text the devices that have
    it in their name, platform or driver version. Raises DeviceError, with the names that there are,
    for one that means nothing or that cannot be used here.
    """
    parent = drivers.chosen_by_parent()
    if parent:  # which has chosen what works
        return [Part(parent, _here(selectors))]
    if not selectors:
        chosen = os.environ.get(DEFAULT, "")
        return resolve([chosen])[:1] if chosen else [default()]
    found: dict[Driver, Part] = {}
    for selector in (" ".join(text.lower().split()) for text in selectors):
        for part in _meant(selector):
            known = found.setdefault(part.driver, part)
            known.infos.extend(info for info in part.infos if info not in known.infos)
    return [found[driver] for driver in drivers.in_order() if driver in found]


def default() -> Part:
    """The first driver that works here, with its first device; raises DeviceError without one.

    Says on standard error which came before it and why they cannot be used.
    """
    tried = []
    for driver in drivers.installed():
        (outcome,) = outcomes([driver])
        if outcome.working:
            for before in tried:
                told = f"{driver.name} is used, as another cannot be: {before.strip()}"
                print(f"freepath: {told}", file=sys.stderr)
            return Part(driver, outcome.working[:1])
        if driver is not drivers.OTHERS or not outcome.reason.startswith(NOTHING):
            tried.append(f"  {driver.name}: {outcome.reason}")
    tried += [f"  {d.name}: {d.missing}" for d in drivers.DRIVERS if d.missing]
    raise DeviceError("\n".join(("no OpenCL driver works here:", *tried, INSTALL)))


def _here(selectors: Sequence[str]) -> list[DeviceInfo]:
    """The devices of this process that selectors mean; all where its driver is named."""
    known = list_devices()
    wanted = [s for s in selectors if s.lower() not in drivers.BY_NAME]
    return [info for info in known if not wanted or any(matches(info, one) for one in wanted)]


def _meant(selector: str) -> Parts:
    if selector in drivers.BY_NAME:
        driver = drivers.BY_NAME[selector]
        if not driver.find():
            raise DeviceError(f"{driver.name}: {driver.missing}")
        (outcome,) = outcomes([driver])
        return [_usable(driver, outcome, outcome.devices)]
    tried = of_installed()
    if selector == "all":
        # what does not work is a failure of what is run, and no reason to run nothing
        return [Part(d, outcome.working, outcome.reason) for d, outcome in tried.items()]
    found = [
        _usable(driver, outcome, infos)
        for driver, outcome in tried.items()
        if (infos := [info for info in outcome.devices if matches(info, selector)])
    ]
    if not found:
        raise DeviceError(_unknown(selector, tried))
    return found


def _usable(driver: Driver, outcome: Outcome, infos: Sequence[DeviceInfo]) -> Part:
    """Those of some devices that work; raises DeviceError where none does."""
    working = [info for info in infos if info in outcome.working]
    if not working:
        raise DeviceError(f"{driver.name} cannot be used here: {outcome.reason}; {REMEDY}")
    return Part(driver, working)


def _unknown(selector: str, tried: dict[Driver, Outcome]) -> str:
    labels = [
        f"  {driver.name}: {info.label}" for driver, one in tried.items() for info in one.devices
    ]
    labels += [f"  {driver.name}: {driver.missing}" for driver in drivers.DRIVERS if driver.missing]
    names = [*drivers.BY_NAME, *(info.name for one in tried.values() for info in one.devices)]
    near = did_you_mean(selector, names)
    return "\n".join((f"no OpenCL device matches '{selector}'{near}; -d takes", *labels))


def checked(parts: Parts) -> Parts:
    """The same; raises DeviceError where two drivers' devices cannot be distinguished.

    Rows are known by name and platform, and those of one would take the place of the other's.
    """
    owners: dict[tuple[str, str], tuple[Driver, DeviceInfo]] = {}
    for driver, infos, _ in parts:
        for info in infos:
            other, known = owners.setdefault((info.name, info.platform), (driver, info))
            if other is not driver:
                raise DeviceError(
                    f"{other.name} and {driver.name} differ by the driver's version alone, and a "
                    "result distinguishes devices by name and platform: "
                    f"{known.label}, {info.label}; run each into a folder of its own"
                )
    return parts


def can_be_here(parts: Parts) -> bool:
    """Tell whether this process can use what is meant; otherwise a process of its own has to."""
    return len(parts) == 1 and drivers.enter(parts[0].driver, list_devices)


def opened(parts: Parts) -> list[Device]:
    """Open the devices of the one driver that this process sees.

    Raises RunError where what had worked no longer does.
    """
    try:
        return [open_devices([selector_of(info)])[0] for part in parts for info in part.infos]
    except DeviceError as error:
        hint = "`freepath devices` tries what works now"
        raise RunError(f"{parts[0].driver.name}: {error}; {hint}") from error


def first(selectors: Sequence[str]) -> Part:
    """The driver of the first device that -d means, and that device; raises DeviceError."""
    part = resolve(selectors)[0]
    if not part.infos:
        raise DeviceError(f"{part.driver.name} cannot be used here: {part.failure or 'no device'}")
    return part._replace(infos=part.infos[:1])


def one_device(selectors: Sequence[str]) -> Device:
    """The first device that -d means, in this process; raises DeviceError where that cannot be."""
    part = first(selectors)
    if not can_be_here([part]):
        seen = drivers.current()
        why = f"this process uses {seen.name}" if seen else "it needs a command in front of Python"
        raise DeviceError(f"{part.driver.name}: {why}; `run` and `check` start one of their own")
    return opened([part])[0]


def selector_of(info: DeviceInfo) -> str:
    """What -d takes for one device."""
    return f"{info.platform} / {info.name} / {info.driver_version}"
