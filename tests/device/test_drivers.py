import signal
import subprocess
import sys
from pathlib import Path

import pytest

from freepath.device import drivers, icd
from freepath.device.drivers import BY_NAME, CHOSEN, DRIVERS, OTHERS, environment_of
from support.made_up import made_up


@pytest.fixture
def vendors(tmp_path, monkeypatch):
    """A folder of .icd files that stands for the system's."""
    folder = tmp_path / "vendors-of-the-system"
    folder.mkdir()
    monkeypatch.setattr(icd, "VENDORS", (tmp_path / "none", folder))
    return folder


def test_a_library_is_found_by_an_icd_file(vendors):
    assert icd.in_icd_files("libpocl") == ""
    (vendors / "a.icd").write_text("libpocl.so.2\n")
    (vendors / "b.icd").write_text("/nowhere/libintelocl.so\n")
    assert icd.in_icd_files("libpocl") == "libpocl.so.2"
    assert icd.in_icd_files("libintelocl.so") == "", "the path that it names is not there"
    library = vendors / "libintelocl.so"
    library.touch()
    (vendors / "c.icd").write_text(f"{library}\n")
    assert icd.in_icd_files("libintelocl.so") == str(library)


def test_a_library_is_found_in_a_package():
    found = icd.in_package("numpy", "__init__.py")
    assert Path(found).is_file()
    assert icd.in_package("numpy", "no such file") == ""
    assert icd.in_package("no-such-package", "__init__.py") == ""


def test_what_is_missing_comes_with_how_to_get_it():
    assert made_up().missing == ""
    assert made_up(found="").missing == "not installed; `make devices`, or `apt-get install it`"


@pytest.mark.parametrize(
    ("platform", "version", "name"),
    [
        ("Portable Computing Language", "3.0-rc2", "pocl-wheel"),
        ("Portable Computing Language", "3.1+debian", "pocl-debian"),
        ("Intel(R) OpenCL", "2026.1", "intel"),
        ("rusticl", "22.3.6", "rusticl"),
        ("Oclgrind", "Oclgrind 21.10", "oclgrind"),
        ("NVIDIA CUDA", "550", None),
    ],
)
def test_a_device_belongs_to_one_driver(platform, version, name):
    owners = [driver.name for driver in DRIVERS if driver.owns(platform, version)]
    assert owners == ([name] if name else [])


def test_a_device_of_a_driver_that_is_not_installed_is_one_of_the_others(monkeypatch):
    monkeypatch.setattr(drivers, "DRIVERS", (made_up(found=""),))
    assert drivers.owner("Maker", "1") is OTHERS
    monkeypatch.setattr(drivers, "DRIVERS", (made_up(),))
    assert drivers.owner("Maker", "1").name == "made-up"
    monkeypatch.setenv(CHOSEN, "others")
    assert drivers.is_in_view("Someone", "1")
    assert not drivers.is_in_view("Maker", "1")


def test_a_process_sees_its_driver_alone(monkeypatch, tmp_path):
    monkeypatch.setenv("OCL_ICD_VENDORS", "/of/the/user")
    monkeypatch.setenv("LD_PRELOAD", "liboclgrind-rt.so")
    monkeypatch.setenv("POCL_MAX_PTHREAD_COUNT", "3")
    found = environment_of(made_up(found="/there/libmine.so", icd=True), tmp_path)
    (written,) = Path(found["OCL_ICD_VENDORS"]).iterdir()
    assert written.suffix == ".icd"
    assert written.read_text() == "/there/libmine.so\n"
    assert "LD_PRELOAD" not in found
    assert found["POCL_MAX_PTHREAD_COUNT"] == "3"
    assert environment_of(OTHERS, tmp_path)["OCL_ICD_VENDORS"] == "/of/the/user"
    assert environment_of(BY_NAME["rusticl"], tmp_path)["RUSTICL_ENABLE"] == "llvmpipe"
    assert Path(environment_of(BY_NAME["oclgrind"], tmp_path)["OCLGRIND_LOG"]).parent == tmp_path


def test_a_process_is_waited_for_captured_and_given_up():
    ended = drivers.in_process_of(made_up(), ["--version"], capture=True)
    assert (ended.returncode, ended.stdout[:8]) == (0, "freepath")
    with pytest.raises(drivers.TimeoutExpired):
        drivers.in_process_of(made_up(), ["60"], module="timeit", capture=True, timeout=0.5)
    crash = made_up(prefix=(sys.executable, "-c", "import os; os.abort()"))
    code = drivers.in_process_of(crash, [], capture=True).returncode
    assert drivers.how_it_ended(code) == "its process was ended by SIGABRT"
    assert drivers.how_it_ended(2) == "its process ended with exit code 2"


WAITS = """
import sys, time
from freepath.device import drivers
from freepath.device.drivers import Driver
inner = "import signal, sys; signal.signal(15, lambda *_: sys.exit(print('in order'))); "
inner += "print('started', flush=True); signal.pause()"
driver = Driver("x", "x", "x", (), lambda: "x", prefix=(sys.executable, "-c", inner))
drivers.in_process_of(driver, [])
"""


def test_an_interruption_waits_for_what_is_under_way():
    with subprocess.Popen([sys.executable, "-c", WAITS], stdout=subprocess.PIPE, text=True) as one:
        assert one.stdout.readline() == "started\n"
        one.send_signal(signal.SIGINT)
        assert one.stdout.read() == "in order\n"
    assert one.returncode != 0


def test_complaints_are_told_once(monkeypatch, tmp_path):
    monkeypatch.delenv(drivers.INTERPRETER_LOG, raising=False)
    assert drivers.Complaints().new() == ""
    log = tmp_path / "log"
    monkeypatch.setenv(drivers.INTERPRETER_LOG, str(log))
    complaints = drivers.Complaints()
    assert complaints.new() == ""
    log.write_text("\n Invalid read \n\n")
    assert complaints.new() == "Invalid read"
    assert complaints.new() == ""
