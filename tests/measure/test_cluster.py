"""A real scheduler and two workers as processes on the loopback: rows are those of one machine."""

import json
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import psutil
import pytest
from tests.measure.test_worker import FRONT

from freepath import api
from freepath.cli import main
from freepath.compose import catalog
from freepath.device.selection import selector_of
from freepath.errors import DeviceError, ResultError, RunError, UsageError
from freepath.measure import cluster, worker
from freepath.results.folder import SAMPLE_COLUMNS, read_rows

pytestmark = pytest.mark.slow

pytest.importorskip("distributed")
CONFIG = """name: far
rays: {orthographic: {resolution: 4}}
matrix:
  medium: [{homogeneous: {sigma_t: 1}}, {volume: {file: sub/v.npy, sigma_t: 2}}]
  tracker: [delta, ratio]
stop: {samples: 64, rounds: 2}
"""
MINE = FRONT.format("is sent as text", "collide(path, path->live);")
DIFFER = (
    "time",
    "inv_efficiency_s",
    "figure_of_merit",
    "lookups_per_s",
    "run_id",
    "device_time_share",
)
DIFFER += ("lane_occupancy", "work_items")  # a worker has one thread


@pytest.fixture(scope="module")
def address():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = ["-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--no-dashboard"]
    with started([*command, "--port", str(port)]):
        yield f"tcp://127.0.0.1:{port}"


@contextmanager
def started(words):
    process = subprocess.Popen([sys.executable, *words], stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.fixture(scope="module")
def workers(address, device):
    """Two, each with a thread of the processor."""
    words = ["-m", "freepath", "worker", address, "-d", selector_of(device.info)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("POCL_MAX_PTHREAD_COUNT", "1")
        patch.setattr(cluster, "CONNECT_S", 300.0)
        with started(words) as one, started(words) as other:
            yield [one, other]


@pytest.fixture
def planted(work):
    (work / "trackers").mkdir()
    (work / "trackers" / "mine.cl").write_text(MINE)
    (work / "sub").mkdir()
    np.save(work / "sub" / "v.npy", np.random.default_rng(1).random((4, 4, 4), np.float32))
    (work / "far.yaml").write_text(CONFIG)
    return work


def rows(folder):
    found = read_rows(Path(folder) / "summary.csv")
    assert len({row["case"] for row in found}) == len(found)
    return {row["case"]: row for row in found}


def children():
    found = []
    for one in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):  # it ends meanwhile
            found += [one] if worker.__name__ in " ".join(one.cmdline()) else []
    return found


def test_rows_are_those_of_one_machine(planted, workers, address, device, monkeypatch, capsys):
    """With a volume and a tracker that only the sender has; the tracker is wrong."""
    sent = []
    kept = cluster.Cluster._send_file
    monkeypatch.setattr(
        cluster.Cluster, "_send_file", lambda self, *given: sent.append(given) or kept(self, *given)
    )
    given = ["run", "far.yaml", "--trackers", "trackers", "-a", "tracker=delta,mine"]
    known = catalog.load(["trackers"])
    axes = ["tracker=delta,mine"]
    api.sweep("far.yaml", "here", known=known, axes=axes, devices=[device]).run()
    assert main([*given, "-o", "there", "--cluster", address]) == 8
    here, there = rows("here"), rows("there")
    assert here.keys() == there.keys()
    assert {row["status"] for row in there.values()} == {"ok", "mismatch"}
    for case, row in there.items():
        differ = {name for name in row if row[name] != here[case][name]}
        assert all(name.startswith(DIFFER) for name in differ), differ
    assert len(read_rows(Path("there/samples.csv"), SAMPLE_COLUMNS)) == 8
    assert len({address for address, *_ in sent}) == len(sent) > 0
    (session,) = json.loads(Path("there/run.json").read_text())["sessions"]
    assert session["ended"] == "complete"
    assert [one["machine"] for one in session["workers"]][0] == session["host"]["machine"]
    assert "freepath: mismatch: " in capsys.readouterr().err
    before = rows("there")
    assert main([*given, "-o", "there", "--cluster", address, "--resume"]) == 8
    assert rows("there") == before


def test_a_worker_that_is_killed_loses_nothing(planted, workers, address):
    told, seen = [], []

    def kill(row):
        seen.append(row["case"])
        if len(seen) == 1:
            workers[0].send_signal(signal.SIGKILL)

    with cluster.Cluster(address, told.append) as there:
        (part,) = there.parts([])
        sweep = api.sweep("far.yaml", "out", axes=["tightness=1,2,4,8"])
        sweep.listener.row = kill
        there.run(sweep, part)
    assert {row["status"] for row in rows("out").values()} == {"ok"}
    assert sorted(seen) == sorted(rows("out"))
    assert len(seen) == 16
    assert sum("was lost" in line for line in told) == len(told) <= 1


def test_an_interruption_ends_what_runs_elsewhere(planted, workers, address):
    def interrupt(row):
        raise KeyboardInterrupt

    with cluster.Cluster(address, pytest.fail) as there:
        (part,) = there.parts([])
        sweep = api.sweep("far.yaml", "out")
        sweep.listener.row = interrupt
        with pytest.raises(KeyboardInterrupt):
            there.run(sweep, part)
    assert len(rows("out")) == 1
    until = time.monotonic() + 60
    while children() and time.monotonic() < until:
        time.sleep(0.1)
    assert not children()


def test_who_is_not_there(workers, address):
    with cluster.Cluster(address, pytest.fail) as there:
        with pytest.raises(DeviceError, match="no device of a worker matches 'nobody'; there are"):
            there.parts(["nobody"])
        assert there.parts(["pthread"])[0].infos


def test_what_listens_is_said(monkeypatch):
    for elsewhere in ("tcp://192.0.2.1:8786", "tls://node7:8786", "192.0.2.1:8786", "nonsense"):
        with pytest.raises(UsageError, match="is not on this machine: name the address to listen"):
            cluster.serve(elsewhere, [])
    monkeypatch.setattr(cluster, "CONNECT_S", 0.2)
    with pytest.raises(RunError, match="no scheduler answers there"):
        cluster.serve("tcp://127.0.0.1:9", [])
    with pytest.raises(RunError, match="no scheduler answers there"):
        cluster.Cluster("tcp://127.0.0.1:9", pytest.fail)


@pytest.mark.parametrize(
    "name", ["../x.log", "/tmp/x.log", "pictures/../../x", "summary.csv", "pictures/.x", "x.log"]
)
def test_files_that_come_back_stay_in_the_folder(tmp_path, name):
    with pytest.raises(ResultError, match="a worker returned a file that no run makes"):
        cluster._write(tmp_path, name, b"x")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "pictures").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ResultError, match="or a link is there"):
        cluster._write(tmp_path, "pictures/a.png", b"x")
    cluster._write(tmp_path, "build-0123.log", b"x")
    assert (tmp_path / "build-0123.log").read_bytes() == b"x"


def test_a_file_that_arrives_damaged_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "_own", [cluster.Own([], tmp_path)])
    (tmp_path / "a").write_bytes(b"abc")
    name = f"{cluster._sha256(tmp_path / 'a')}.npy"
    cluster.keep(name, 0, b"ab", last=False)
    cluster.keep(name, 2, b"c", last=True)
    assert (tmp_path / name).read_bytes() == b"abc"
    with pytest.raises(ValueError, match="arrived damaged"):
        cluster.keep(name, 0, b"abd", last=True)
    with pytest.raises(ValueError, match="x"):
        cluster.keep("../x", 0, b"", last=True)


def test_a_case_at_which_workers_vanish_is_given_up(planted, device):
    """The second time alone: the others go on. By whose fault is not known, so it may run again."""
    sweep = api.sweep("far.yaml", "out")
    fake = object.__new__(cluster.Cluster)
    fake._sweep, fake._errands, told = sweep, {}, []
    fake._say, fake._heard = told.append, cluster.queue.SimpleQueue()

    class Future:
        def cancel(self):
            pass

    def distribute(groups):
        jobs = {job.case.case_id: job for group in groups for job in group}
        culprit = list(jobs)[2]
        fake._errands["a"] = cluster.Errand("a", "gone", jobs, culprit, Future())
        assert [len(group) for group in fake._lost({})] == [2, 1, 1]
        alone = {culprit: jobs[culprit]}
        fake._errands["b"] = cluster.Errand("b", "gone", alone, "", Future())
        assert fake._lost({}) == []

    sweep.elsewhere = distribute
    sweep.devices = [cluster.Elsewhere(device.info)]
    sweep.run()
    (row,) = read_rows(Path("out/summary.csv"))
    assert row["status"] == "run_failed"
    assert row["reason"] == f"{cluster.LOST['reason']}, also when it was tried again alone"
    assert "gone was lost; 4 cases go to others" in told[0]
