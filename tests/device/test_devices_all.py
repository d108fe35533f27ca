"""Every driver that is installed, in its own process, makes the same of every tracker."""

import pickle
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from freepath.device import drivers
from support.flights import DEFECTS, chosen_cases, name_of

pytestmark = pytest.mark.slow
NAMES = [driver.name for driver in drivers.DRIVERS]
TRACKERS = sorted({axes["tracker"] for axes in chosen_cases()})
RARE = 0.03  # samples that the last bit of a logarithm may send another way


@pytest.fixture(scope="module")
def made_by(tmp_path_factory):
    """What a driver makes of all cases; skips where it is not installed."""

    @cache
    def run(name):
        folder = tmp_path_factory.mktemp(name)
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("PYTHONPATH", str(Path(__file__).parents[1]))
            ended = drivers.in_process_of(
                drivers.BY_NAME[name],
                [str(folder)],
                module="support.flights",
                capture=True,
                timeout=900,
            )
        assert ended.returncode == 0, ended.stderr[-3000:]
        return pickle.loads((folder / "found").read_bytes())

    def made(name):
        if drivers.BY_NAME[name].missing:
            pytest.skip(f"{name} is {drivers.BY_NAME[name].missing}")
        return run(name)

    return made


@pytest.mark.parametrize("tracker", TRACKERS)
@pytest.mark.parametrize("name", NAMES)
def test_samples_are_the_same_on_each(made_by, name, tracker):
    """Nothing is built wrong, read or written where it must not be, or computed otherwise."""
    flights, others = made_by(name)["flights"], made_by("pocl-wheel")["flights"]
    (case,) = [axes for axes in map(name_of, chosen_cases()) if axes.split("/")[0] == tracker]
    mine, other = flights[case], others[case]
    assert not isinstance(other, str), other
    assert not isinstance(mine, str), mine
    close = np.isclose(mine["score"], other["score"], rtol=1e-3, atol=1e-5)
    assert close.mean() > 1 - RARE, case
    # a ray through a voxel's edge may cross a cell more or less
    difference = np.abs(mine["lookups"] - other["lookups"])
    assert (difference <= (2 if tracker == "regular" else 0)).mean() > 1 - RARE, case


@pytest.mark.parametrize("name", NAMES)
def test_a_device_is_its_driver_s(made_by, name):
    info = made_by(name)["info"]
    assert drivers.owner(info.platform, info.driver_version).name == name
    assert info.interpreted == (name == "oclgrind")
    assert info.timing_source == ("wall" if name == "rusticl" else "device")


@pytest.mark.parametrize("what", DEFECTS)
def test_an_interpreter_s_complaint_is_an_error(made_by, what):
    said = made_by("oclgrind")["defects"][what]
    assert bool(said) == (what != "nothing wrong"), said
    assert not said or said.startswith("RunError: Oclgrind")


def test_work_that_a_driver_leaves_undone_is_an_error(made_by):
    said = made_by("rusticl")["endless"]
    assert isinstance(said, str)
    assert "DriverLimitError" in said
    assert "ends loops after 65535 rounds" in said
