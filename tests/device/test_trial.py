"""Whether a driver works is tried in a process of its own: one that hangs or crashes is named."""

import ctypes
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from freepath import paths
from freepath.device import cpu_name, drivers, environment, trial
from freepath.device.trial import Outcome, outcomes
from support.made_up import made_up

PLANTED = Path(__file__).parents[1] / "support" / "planted_cpu"
ABORTS = (sys.executable, "-c", "import os; os.abort()")
LISTS = "import json; print(json.dumps({{'info': {info!r}{more}}}), flush=True); {then}"


@pytest.fixture(autouse=True)
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("FREEPATH_CACHE", str(tmp_path / "cache"))


def process(device, then, more=""):
    """A driver whose process lists a device and then does something."""
    code = LISTS.format(info=vars(device.info), more=more, then=then)
    return made_up("odd", prefix=(sys.executable, "-c", code))


def test_drivers_that_crash_hang_or_babble(device, monkeypatch):
    monkeypatch.setattr(trial, "TRIAL_S", 1.5)
    odd = [
        made_up("aborts", prefix=ABORTS),
        made_up("babbles", prefix=(sys.executable, "-c", "print('no JSON')")),
        made_up("absent", prefix=("no-such-program",)),
        process(device, "import os; os.abort()"),
        process(device, "import time; time.sleep(60)"),
        process(device, "pass", more=", 'failure': 'error: no such CPU'"),
        process(device, "pass", more=", 'failure': ''"),
    ]
    reasons = [outcome.reason for outcome in outcomes(odd)]
    assert reasons[:4] == [
        "its process was ended by SIGABRT",
        "it lists no device",
        "[Errno 2] No such file or directory: 'no-such-program'",
        "its process was ended by SIGABRT",
    ]
    assert reasons[4].endswith("did not build and run a kernel within 1.5 s and was stopped")
    assert reasons[5:] == ["error: no such CPU", ""]


def test_an_outcome_is_kept_until_something_changes(device, monkeypatch, tmp_path):
    driver = process(
        device, f"open({str(tmp_path / 'tries')!r}, 'a').write('x')", ", 'failure': ''"
    )

    def tries():
        assert outcomes([driver]) == [Outcome((device.info,), ("",))]
        return len((tmp_path / "tries").read_text())

    assert [tries(), tries()] == [1, 1]
    monkeypatch.setenv("POCL_MAX_PTHREAD_COUNT", "1")
    assert tries() == 2, "a variable that steers a driver"
    monkeypatch.setattr(cpu_name, "cpu_flags", lambda: {"another"})
    assert tries() == 3, "another CPU"
    trial.cache_file().write_text("{")
    assert tries() == 4, "a damaged file"
    outcomes([driver], afresh=True)
    assert len((tmp_path / "tries").read_text()) == 5
    trial.cache_file().unlink()
    trial.cache_file().mkdir()
    assert tries() == 6, "a cache that cannot be written"


def test_what_ran_out_of_time_on_a_busy_machine_is_not_kept(device, monkeypatch):
    monkeypatch.setattr(trial, "TRIAL_S", 0.5)
    hangs = process(device, "import time; time.sleep(60)")
    for load, kept in ((1000.0, 0), (0.0, 1)):
        monkeypatch.setattr(environment, "load", lambda load=load: load)
        (outcome,) = outcomes([hangs])
        assert "within 0.5 s" in outcome.reason
        assert len(trial._kept()) == kept


def test_the_trial_sees_a_kernel_that_is_wrong(device, monkeypatch):
    assert trial.try_device(device) == ""
    monkeypatch.setattr(trial, "KERNEL", trial.KERNEL.replace("exp(-x)", "exp(x)"))
    assert "is right" in trial.try_device(device)
    monkeypatch.setattr(
        trial, "KERNEL", trial.KERNEL.replace("exp(x)", "exp(-x)").replace("atomic_inc", "")
    )
    assert "an atomic counter came to 0 instead of 8" in trial.try_device(device)
    monkeypatch.setattr(trial, "KERNEL", "__kernel void track(void) { nonsense; }")
    assert "error: " in trial.try_device(device)


def test_a_cache_folder_that_pocl_cannot_make_is_named(monkeypatch, tmp_path):
    wheel = drivers.BY_NAME["pocl-wheel"]
    if wheel.missing:
        pytest.skip(wheel.missing)
    (tmp_path / "file").touch()
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path / "file" / "below"))
    (outcome,) = outcomes([wheel])
    assert not outcome.working
    assert "POCL_CACHE_DIR cannot be made: Not a directory" in outcome.reason


SOME = {"sse2", "ssse3", "sse4_1", "avx", "f16c", "movbe", "bmi1", "bmi2", "fma", "abm", "avx2"}
AVX512 = {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}


@pytest.mark.parametrize(
    ("flags", "name"),
    [
        (SOME | AVX512, "skx"),
        (SOME, "haswell"),
        (SOME - {"avx2"}, "btver2"),
        (SOME - {"fma"}, "btver2"),
        (SOME - {"avx2", "bmi1"}, "penryn"),
        ({"sse2", "avx", "fma4", "xop"}, "bdver1"),
        ({"sse2", "ssse3"}, "core2"),
        ({"sse2"}, "x86-64"),
        (set(), ""),
    ],
)
def test_the_name_fits_what_the_cpu_has(flags, name):
    assert cpu_name.name_for(flags) == name
    assert len(name) <= len(cpu_name.UNKNOWN)


@pytest.mark.parametrize(
    ("version", "held", "after"),
    [
        ("3.0-rc2", b"generic", b"haswell"),
        ("3.0-rc2", b"generic2", b"generic2"),
        ("3.0-rc2", b"znver3", b"znver3"),
        ("3.1+debian", b"generic", b"generic"),
    ],
)
def test_only_the_known_string_of_the_known_version_is_mended(version, held, after):
    name = ctypes.create_string_buffer(held)
    structure = ctypes.create_string_buffer(cpu_name.OFFSET + 8)
    place = ctypes.addressof(structure)
    ctypes.c_void_p.from_address(place + cpu_name.OFFSET).value = ctypes.addressof(name)
    mended = cpu_name.mend(version, place, lambda: SOME)
    assert name.value == after
    assert mended == ("" if held == after else "haswell")
    ctypes.c_void_p.from_address(place + cpu_name.OFFSET).value = None
    assert cpu_name.mend(version, place, lambda: SOME) == ""


@pytest.fixture
def planted(tmp_path, monkeypatch):
    """Run freepath where PoCL's wheel calls the CPU by another name."""
    if drivers.BY_NAME["pocl-wheel"].missing:
        pytest.skip(drivers.BY_NAME["pocl-wheel"].missing)

    def run(name, *words):
        environment = {**os.environ, "PYTHONPATH": str(PLANTED), "PLANTED_CPU": name}
        environment |= {"FREEPATH_CACHE": str(tmp_path / name)}
        environment.pop(drivers.CHOSEN, None)
        command = [sys.executable, "-m", "freepath", *words]
        ended = subprocess.run(
            command,
            check=False,
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
        )
        return ended.returncode, ended.stdout, ended.stderr

    return run


def test_a_cpu_that_the_wheel_does_not_know_is_mended(planted):
    """The fault of CPUs that came after its compiler, on any CPU."""
    words = ["run", "quick", "-d", "pocl-wheel", "-R", "exponential.*delta", "-o", "planted"]
    code, out, err = planted("generic", *words)
    assert code == 0, err
    assert "mismatch" not in out


COMMANDS = (
    ["run", "quick", "-o", "out"],
    ["recommend", "cloud.npy"],
    ["check", "-L", "tiny"],
    ["try", "mine.cl"],
    ["source", "quick", "--case", "1"],
)


@pytest.mark.parametrize("name", ["znver9", "crash"])
def test_a_driver_that_builds_nothing_is_named_by_every_command(planted, tmp_path, name):
    import numpy as np

    np.save(tmp_path / "cloud.npy", np.ones((4, 4, 4), np.float32))
    mine = (paths.KERNELS / "trackers/delta.cl").read_text("utf-8")
    (tmp_path / "mine.cl").write_text(mine)
    cause = "its process was ended by SIGABRT" if name == "crash" else "unknown target CPU 'znver9'"
    if name == "znver9":
        code, out, _ = planted(name, "devices", "--json")
        (wheel,) = [record for record in json.loads(out) if record["-d"] == "pocl-wheel"]
        assert code == 0
        assert cause in wheel["works"]
    for words in COMMANDS if name == "znver9" else COMMANDS[:1]:
        code, out, err = planted(name, *words, "-d", "pocl-wheel")
        assert code == 2, (words, out, err)
        (line,) = err.splitlines()
        assert line.startswith("freepath: pocl-wheel cannot be used here: ")
        assert cause in line
