import dataclasses

import pytest

from freepath.device import drivers, selection
from freepath.device.drivers import CHOSEN, OTHERS
from freepath.device.opencl import list_devices
from freepath.device.selection import Part, resolve, selector_of
from freepath.device.trial import Outcome
from freepath.errors import DeviceError
from support.made_up import made_up


@pytest.fixture
def offered(monkeypatch, device):
    """Two made-up drivers that work and one that does not, and what their trials showed."""
    monkeypatch.delenv(CHOSEN, raising=False)
    monkeypatch.delenv(selection.DEFAULT, raising=False)
    one, two, bad = made_up("one"), made_up("two"), made_up("bad")
    infos = {
        driver: dataclasses.replace(device.info, name=name, platform="Maker")
        for driver, name in ((one, "Cray-1"), (two, "Cray-2"), (bad, "Apple II"))
    }
    tried = {bad: Outcome((infos[bad],), ("error: unknown target CPU",))}
    tried |= {driver: Outcome((infos[driver],), ("",)) for driver in (one, two)}
    absent = made_up("absent", found="")
    monkeypatch.setattr(drivers, "DRIVERS", (bad, absent, one, two))
    monkeypatch.setattr(drivers, "BY_NAME", {d.name: d for d in drivers.DRIVERS})
    monkeypatch.setattr(drivers, "strangers", dict)
    monkeypatch.setattr(selection, "of_installed", lambda: tried)
    monkeypatch.setattr(selection, "outcomes", lambda wanted: [tried[d] for d in wanted])
    return one, two, bad, infos


def test_the_default_is_the_first_that_works(offered, monkeypatch, capsys):
    one, two, _, infos = offered
    assert resolve([]) == [Part(one, [infos[one]])]
    why = "one is used, as another cannot be: bad: error: unknown target CPU"
    assert capsys.readouterr().err == f"freepath: {why}\n"
    monkeypatch.setenv(selection.DEFAULT, "two")
    assert resolve([]) == [Part(two, [infos[two]])]
    monkeypatch.setattr(drivers, "DRIVERS", drivers.DRIVERS[:2])
    monkeypatch.delenv(selection.DEFAULT)
    with pytest.raises(DeviceError) as caught:
        resolve([])
    assert str(caught.value).splitlines() == [
        "no OpenCL driver works here:",
        "  bad: error: unknown target CPU",
        "  absent: not installed; `make devices`, or `apt-get install it`",
        "`make devices` installs those that it can",
    ]


def test_names_parts_of_names_and_all(offered):
    one, two, bad, infos = offered
    assert resolve(["two", " One "]) == [Part(one, [infos[one]]), Part(two, [infos[two]])]
    assert (
        resolve(["cray"])
        == resolve(["cray-2", "cray-1", "maker / cray"])
        == resolve(["one", "two"])
    )
    assert resolve([selector_of(infos[two])]) == [Part(two, [infos[two]])]
    unusable = Part(bad, [], "error: unknown target CPU")
    assert resolve(["all"]) == [unusable, *resolve(["one", "two"])]


@pytest.mark.parametrize(
    ("selector", "message"),
    [
        ("bad", "^bad cannot be used here: error: unknown target CPU; choose another by -d"),
        ("apple", "^bad cannot be used here: error: unknown target CPU"),
        ("absent", "^absent: not installed; `make devices`, or `apt-get install it`"),
        ("twoo", r"^no OpenCL device matches 'twoo'; did you mean 'two'\?; -d takes\n"),
        ("vax", r"(?s)matches 'vax'; -d takes\n.*  one: Cray-1 .*  absent: not installed"),
        ("", "matches ''"),
    ],
)
def test_what_cannot_be_meant_says_why(offered, selector, message):
    with pytest.raises(DeviceError, match=message):
        resolve([selector])


def test_a_driver_s_process_takes_what_it_is_given(monkeypatch, device):
    monkeypatch.setenv(CHOSEN, OTHERS.name)
    monkeypatch.setattr(selection, "list_devices", lambda: [device.info])
    assert resolve([]) == [Part(OTHERS, [device.info])]
    assert resolve([selector_of(device.info)]) == [Part(OTHERS, [device.info])]
    assert resolve(["no such thing"]) == [Part(OTHERS, [])]


def test_drivers_that_differ_by_their_version_alone_are_refused(offered):
    one, two, _, infos = offered
    alike = dataclasses.replace(infos[one], driver_version="2.0")
    parts = [Part(one, [infos[one]]), Part(two, [alike])]
    with pytest.raises(DeviceError, match=r"^one and two differ by .*Cray-1.* 2\.0\); run each"):
        selection.checked(parts)
    fine = [Part(one, [infos[one]]), Part(two, [infos[two]])]
    assert selection.checked(fine) == fine


def test_a_process_sees_one_driver(device):
    seen = drivers.current()
    assert seen is not None
    assert all(drivers.owner(i.platform, i.driver_version) is seen for i in list_devices())
    assert selection.can_be_here([Part(seen, [device.info])])
    other = next(driver for driver in drivers.DRIVERS if driver is not seen)
    assert not selection.can_be_here([Part(other, [device.info])])
    assert not selection.can_be_here([Part(seen, []), Part(seen, [])])
