"""A sweep on the workers of dask's scheduler: here they are served, there they serve.

What is sent is a description of some cases on a device: the config, trackers as text, files by
their hash. A worker makes a sweep of it and runs that in a process that is watched, as on one
machine. Rows come back as they are written there, and are written here.
"""

from __future__ import annotations

import asyncio
import dataclasses
import functools
import hashlib
import ipaddress
import json
import logging
import math
import queue
import re
import signal
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from freepath import __version__
from freepath import config as configs
from freepath.cases import plan
from freepath.cases.plan import Case
from freepath.compose import catalog
from freepath.compose.catalog import Catalog
from freepath.config import Config
from freepath.device import environment
from freepath.device.drivers import Driver
from freepath.device.opencl import DeviceInfo, matches
from freepath.device.selection import Part, selector_of
from freepath.errors import DeviceError, FreepathError, ResultError, RunError, UsageError, imported
from freepath.measure import worker
from freepath.measure.jobs import Job
from freepath.measure.sweep import Listener, Sweep
from freepath.paths import KERNELS
from freepath.results.columns import COLUMNS
from freepath.results.folder import CONFIRM_COLUMNS, SAMPLE_COLUMNS, ResultFolder, replacing, texts
from freepath.scene.volumes.files import find_file

CONNECT_S = 60.0
"""Within which a scheduler, and a first worker, must answer."""
PIECE = 1 << 24
"""Bytes of a file that are sent at once."""
HASH = re.compile(r"[0-9a-f]{64}\.\w{1,8}")
RETURNED = re.compile(r"(build-\w+|equal-time)\.log|pictures/(equal-time/)?[\w+=-][\w.+=-]*")
"""Files beside the tables that come back; others are refused."""
LOST = {
    "status": "run_failed",
    "reason": "its worker was lost while it was at work, by whose fault is not known",
}
"""What is said of a case that was at work, or is taken for it, when a worker vanished."""
Message = dict[str, Any]


# On a worker


@dataclasses.dataclass
class Own:
    """What a worker has: its devices, and a folder for the files that it is sent."""

    parts: list[Part]
    folder: Path


_own: list[Own] = []


def serve(address: str, parts: Sequence[Part], host: str = "") -> None:
    """Be a worker of a scheduler with devices, until it or the user ends that.

    Listens on the loopback unless a `host` is given. Raises UsageError for a scheduler elsewhere
    without one, and RunError where none answers.
    """
    distributed = imported("distributed", "freepath worker")
    if not host and not _is_loopback(address):
        told = "is not on this machine: name the address to listen on by --host"
        raise UsageError(f"{address}: {told} (docs/sweeps.md: who reaches it can run code here)")
    logging.getLogger("distributed").setLevel(logging.WARNING)
    announced: list[Message] = [
        {"driver": part.driver.name, "info": dataclasses.asdict(info)}
        for part in parts
        for info in part.infos
    ]
    own: Message = {
        "version": _version(),
        "about": environment.describe(),
        "devices": announced,
    }

    async def run() -> None:
        options = {
            "nthreads": 1,  # devices of one machine share its cores: one case at a time
            "resources": {_named(one): 1 for one in announced},
            "host": host or "127.0.0.1",
            "memory_limit": 0,
            "death_timeout": CONNECT_S,
            "startup_information": {"freepath": lambda _: own},
        }
        stop = asyncio.Event()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            asyncio.get_running_loop().add_signal_handler(number, stop.set)
        async with distributed.Worker(address, **options) as one:
            ends = [asyncio.ensure_future(end) for end in (one.finished(), stop.wait())]
            await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        if stop.is_set():
            raise KeyboardInterrupt

    with tempfile.TemporaryDirectory(prefix="freepath-") as folder:
        _own[:] = [Own(list(parts), Path(folder))]
        try:
            asyncio.run(run())
        except (OSError, TimeoutError, ValueError) as error:
            raise RunError(f"{address}: no scheduler answers there: {error}") from error


def _is_loopback(address: str) -> bool:
    host = address.rpartition("://")[2].rpartition(":")[0].strip("[]")
    with suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return host == "localhost"


@functools.cache
def _version() -> str:
    """Of all that decides what is measured: the package and its kernels."""
    digest = hashlib.sha256(__version__.encode())
    for folder, pattern in ((KERNELS, "*.cl"), (Path(__file__).parents[1], "*.py")):
        for path in sorted(folder.rglob(pattern)):
            digest.update(path.read_bytes())
    return f"{__version__} {digest.hexdigest()[:12]}"


def _label(driver: str, info: dict[str, Any]) -> str:
    return f"{driver}: {selector_of(DeviceInfo(**info))}"


def _named(announced: Message) -> str:
    return _label(announced["driver"], announced["info"])


def keep(name: str, offset: int, piece: bytes, *, last: bool) -> None:
    """Write a piece of a file into the worker's folder; the last one completes it."""
    if not HASH.fullmatch(name):
        raise ValueError(name)
    folder = _own[0].folder
    with open(folder / f"{name}.part", "ab" if offset else "wb") as file:
        file.write(piece)
    if last:
        if _sha256(folder / f"{name}.part") != name.partition(".")[0]:
            raise ValueError(f"{name}: arrived damaged")
        (folder / f"{name}.part").rename(folder / name)


def measure(sent: Message) -> Message:
    """Measure the cases of a description; its rows are reported as events of dask.

    Returns the files that lie beside the tables, or under `failed` why nothing was measured.
    """
    own = _own[0]
    config, known, cases = _read(sent["config"], tuple(sent["overridden"]), tuple(sent["trackers"]))
    meant = [
        Part(part.driver, [info])
        for part in own.parts
        for info in part.infos
        if _label(part.driver.name, dataclasses.asdict(info)) == sent["device"]
    ]
    with tempfile.TemporaryDirectory(prefix="freepath-") as name:
        folder = Path(name) / "out"
        sweep = Sweep(
            config,
            known,
            [cases[case_id] for case_id in sent["cases"]],
            [],
            ResultFolder(folder, confirm=sent["confirm"]),
            Far(sent),
            confirm=sent["confirm"],
            work_group=sent["work_group"],
            run_id=sent["run_id"],
            files={name: own.folder / copy for name, copy in sent["files"].items()},
            tells_rounds=True,
        )
        try:
            worker.run(sweep, meant[0], sent["timeout_s"])
        except KeyboardInterrupt:
            return {"failed": "interrupted"}
        except FreepathError as error:
            return {"failed": str(error)}
        paths = (path for path in folder.rglob("*") if path.is_file())
        named = {path.relative_to(folder).as_posix(): path for path in paths}
        return {"files": {n: p.read_bytes() for n, p in named.items() if RETURNED.fullmatch(n)}}


@functools.lru_cache(maxsize=2)
def _read(
    text: str, overridden: tuple[str, ...], trackers: tuple[tuple[str, str], ...]
) -> tuple[Config, Catalog, dict[str, Case]]:
    """Config, trackers and cases of a description; all are checked as files are."""
    with tempfile.TemporaryDirectory(prefix="freepath-") as name:
        folder = Path(name)
        for stem, code in trackers:
            (folder / f"{Path(stem).name}.cl").write_text(code, "utf-8")
        known = catalog.load([folder] if trackers else [])
        (folder / "sent.yaml").write_text(text, "utf-8")
        config = configs.load(folder / "sent.yaml", known.parameter_models())
    config.override(frozenset(overridden))
    return config, known, {case.case_id: case for case in plan.expand(config, known)}


class Far(Listener):
    """Reports the rows of a sweep to who has sent it, and ends it where nobody waits for it."""

    def __init__(self, sent: Message):
        self._worker = imported("distributed", "a worker").get_worker()
        self._sent = sent
        self._ids = sent["cases"]
        self._further: tuple[list[dict[str, str]], ...] = ([], [])
        self._at, self._next = -1, 0.0

    def _tell(self, **said: Any) -> None:
        self._worker.log_event(self._sent["run_id"], {"key": self._sent["key"], **said})

    def rounds(self, *kinds: list[dict[str, Any]]) -> None:
        columns = (SAMPLE_COLUMNS, CONFIRM_COLUMNS)
        pairs = zip(kinds, columns, strict=False)
        self._further = tuple([texts(row, names) for row in kind] for kind, names in pairs)

    def row(self, row: dict[str, Any]) -> None:
        self._tell(row=texts(row, COLUMNS), further=self._further)

    def look(self, number: int) -> None:
        task = self._worker.state.tasks.get(self._sent["key"])
        serving = self._worker.status.name in ("running", "paused")
        if task is None or task.state == "cancelled" or not serving:
            raise KeyboardInterrupt
        now = time.monotonic()
        if number >= 0 and number != self._at and now >= self._next:
            self._at, self._next = number, now + worker.LOOK_S
            self._tell(at=self._ids[number % len(self._ids)])


# Where the run was started


class Elsewhere:
    """A device of workers: enough of one to compose sources for it."""

    def __init__(self, info: DeviceInfo):
        self.info = info
        self.compiler_log: Path | None = None
        self.state: Any = None

    def group_by(self, size: int | None) -> None:
        """Left to the worker."""


@dataclasses.dataclass
class Errand:
    """Cases that a worker measures: those without a row yet, by their ids."""

    key: str
    address: str
    left: dict[str, Job]
    at: str = ""
    """The case at work, as far as was told."""
    future: Any = None


class Cluster:
    """The workers of a scheduler, as what measures sweeps."""

    def __init__(self, address: str, say: Callable[[str], None]):
        """Connect; raises RunError where no scheduler answers, `say` gets what a user must know."""
        distributed = imported("distributed", "freepath run --cluster")
        logging.getLogger("distributed").setLevel(logging.ERROR)
        self.address, self._say = address, say
        try:
            self._client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            hint = "start one by `dask scheduler --host 127.0.0.1`"
            raise RunError(f"{address}: no scheduler answers there: {error}; {hint}") from error
        self._heard: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._refused: dict[str, str] = {}
        self._have: dict[str, set[str]] = {}

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()

    def workers(self) -> dict[str, Message]:
        """What each worker says of itself, by its address: those that can be used.

        Raises RunError where the scheduler is gone.
        """
        try:  # what the client itself keeps of it has no workers in it now and then
            identity = self._client.sync(self._client.scheduler.identity, n_workers=-1)
        except OSError as error:
            hint = "rows that were finished stand; go on by --resume"
            raise RunError(f"{self.address}: the scheduler is gone: {error}; {hint}") from error
        listed = identity["workers"]
        found = {at: one["freepath"] for at, one in listed.items() if "freepath" in one}
        for at, one in found.items():
            if one["version"] != _version():
                self._refuse(at, one, f"it has freepath {one['version']}, here is {_version()}")
        return {at: one for at, one in found.items() if at not in self._refused}

    def _refuse(self, at: str, one: Message, why: str) -> None:
        if at not in self._refused:
            self._refused[at] = why
            self._say(f"worker {at} on {one['about'].get('machine')} is not used: {why}")

    def parts(self, selectors: Sequence[str]) -> list[Part]:
        """The devices that workers have and -d means; those alike on several hosts are one.

        Raises RunError where there is no worker, DeviceError where a selector means none of them.
        """
        until = time.monotonic() + CONNECT_S
        while not (there := self.workers()):
            if time.monotonic() > until:
                hint = f"start one by `freepath worker {self.address}`"
                raise RunError(f"{self.address}: no worker within {CONNECT_S:g} s; {hint}")
            time.sleep(worker.LOOK_S)
        known: dict[str, tuple[str, DeviceInfo]] = {}
        for one in (device for worker_ in there.values() for device in worker_["devices"]):
            known.setdefault(_named(one), (one["driver"], DeviceInfo(**one["info"])))
        for selector in selectors:
            if not any(_means(selector, *one) for one in known.values()):
                raise DeviceError(
                    f"no device of a worker matches '{selector}'; there are {', '.join(known)}"
                )
        chosen = [
            one
            for one in known.values()
            if not selectors or any(_means(selector, *one) for selector in selectors)
        ]
        driver = Driver("cluster", f"workers of {self.address}", "", (), lambda: "yes")
        self._labels = {info.label: _label(name, dataclasses.asdict(info)) for name, info in chosen}
        return [Part(driver, [info for _, info in chosen])]

    def run(self, sweep: Sweep, part: Part, timeout_s: float | None = None) -> None:
        """Run a sweep on the devices of a part; rows are written here as workers report them.

        Scenes stay whole on a worker. A case at which workers vanish twice, the second time alone,
        is given up with a row. Raises RunError where no worker is left that can be used.
        """
        devices: Any = [Elsewhere(info) for info in part.infos]
        sweep.devices = devices
        self._sweep, self._timeout_s = sweep, timeout_s
        self._errands: dict[str, Errand] = {}
        self._count = 0
        sweep.elsewhere = self._distribute
        try:
            sweep.run()
        finally:
            sweep.elsewhere = None

    def _distribute(self, groups: list[list[Job]]) -> None:
        run_id = self._sweep.run_id
        self._client.subscribe_topic(run_id, lambda event: self._heard.put(event[1]))
        waiting, told, asked = list(groups), False, -math.inf
        try:
            while waiting or self._errands:
                if time.monotonic() > asked + worker.LOOK_S:
                    there, asked = self.workers(), time.monotonic()
                    self._note(there)
                waiting += self._lost(there)
                waiting = self._send(waiting, there)
                if not self._errands and waiting and not told:
                    names = sorted({self._label_of(group) for group in waiting})
                    self._say(f"waiting for a worker with {', '.join(names)}")
                    told = True
                if not self._errands and self._refused and not there:
                    raise RunError(f"no worker is left: {'; '.join(self._refused.values())}")
                self._sweep.progress(0.0, f"measuring on {len(self._errands)} workers")
                with suppress(queue.Empty):
                    waiting += self._take_in(self._heard.get(timeout=worker.LOOK_S), there)
        finally:
            self._client.unsubscribe_topic(run_id)
            for errand in self._errands.values():
                if errand.future:
                    errand.future.cancel()

    def _note(self, there: dict[str, Message]) -> None:
        """Have run.json say which machines measured."""
        abouts = [one["about"] for one in there.values()]
        if abouts:
            shared = {k: v for k, v in abouts[0].items() if all(a.get(k) == v for a in abouts)}
            known = self._sweep.beside.setdefault("workers", [])
            known += [one for one in abouts if one not in known]
            self._sweep.beside["host"] = shared

    def _send(self, waiting: list[list[Job]], there: dict[str, Message]) -> list[list[Job]]:
        """Give each worker without an errand some of the groups; returns those that are left.

        Many at first, so that few processes are started, and fewer towards the end, so that all
        workers end together.
        """
        busy = {errand.address for errand in self._errands.values()}
        for at, one in there.items():
            labels = set(map(_named, one["devices"]))
            mine = [group for group in waiting if self._label_of(group) in labels]
            if at in busy or not mine:
                continue
            device = self._label_of(mine[0])
            mine = [group for group in mine if self._label_of(group) == device]
            alike = sum(device in map(_named, other["devices"]) for other in there.values())
            alone = self._sweep.died(mine[0][0])
            few = 1 if alone else math.ceil(len(mine) / (2 * alike))
            taken = [group for group in mine if alone or not self._sweep.died(group[0])][:few]
            jobs = {job.case.case_id: job for group in taken for job in group}
            waiting = [group for group in waiting if group not in taken]
            self._count += 1
            errand = Errand(f"freepath-{self._sweep.run_id}-{self._count}", at, jobs)
            self._errands[errand.key] = errand
            self._submit(errand, device)
        return waiting

    def _label_of(self, group: list[Job]) -> str:
        return self._labels[group[0].device.info.label]

    def _submit(self, errand: Errand, device: str) -> None:
        sweep = self._sweep
        cases = [job.case for job in errand.left.values()]
        own = [t for t in sweep.catalog.trackers.values() if KERNELS not in t.path.parents]
        sent: Message = {
            "key": errand.key,
            "run_id": sweep.run_id,
            "device": device,
            "config": json.dumps(sweep.config.as_dict()),
            "overridden": sorted(sweep.config.overridden),
            "trackers": [(tracker.name, tracker.path.read_text("utf-8")) for tracker in own],
            "cases": list(errand.left),
            "files": dict(self._files(cases)),
            "confirm": sweep.confirm,
            "work_group": sweep.work_group,
            "timeout_s": self._timeout_s,
        }
        with suppress(OSError, KeyError, ValueError):  # it has vanished, which is seen later
            for name, copy in sent["files"].items():
                self._send_file(errand.address, name, copy)
        errand.future = self._client.submit(
            measure,
            sent,
            key=errand.key,
            workers=[errand.address],
            resources={device: 1},
            pure=False,
        )
        errand.future.add_done_callback(lambda _: self._heard.put({"key": errand.key, "done": 1}))

    def _files(self, cases: Iterable[Case]) -> Iterator[tuple[str, str]]:
        """Files that cases name, with the names of their copies: the hash of what they hold."""
        for case in cases:
            for model, key in ((case.medium, "file"), (case.light, "file"), (case.rays, "path")):
                if name := getattr(model, key, None):
                    path = find_file(name, self._sweep.config.search_path)
                    yield name, f"{_sha256(path)}{path.suffix or '.file'}"

    def _send_file(self, address: str, name: str, copy: str) -> None:
        """Send a file to a worker that does not have it."""
        if copy in self._have.setdefault(address, set()):
            return
        path = find_file(name, self._sweep.config.search_path)
        size, offset = path.stat().st_size, 0
        with path.open("rb") as file:
            while piece := file.read(PIECE):
                last = offset + len(piece) >= size
                self._client.run(keep, copy, offset, piece, last=last, workers=[address])
                offset += len(piece)
        self._have[address].add(copy)

    def _take_in(self, said: Message, there: dict[str, Message]) -> list[list[Job]]:
        """Take in what a worker says; returns groups that are to be measured again."""
        errand = self._errands.get(said["key"])
        if errand is None:
            return []
        errand.at = said.get("at", errand.at)
        if "row" in said:
            self._row(errand, said, there)
        return self._done(errand, there) if "done" in said else []

    def _row(self, errand: Errand, said: Message, there: dict[str, Message]) -> None:
        row = said["row"]
        job = errand.left.get(row["case_id"])
        if job is None:  # not asked for
            return
        if row["source_sha256"] != job.row["source_sha256"] or tuple(row) != COLUMNS:
            raise RunError(f"worker {errand.address} composes other sources: of another freepath?")
        del errand.left[row["case_id"]]
        row["inputs"] = job.row["inputs"]  # there the copy of a file has another name
        self._sweep.finish(row, *said["further"])

    def _done(self, errand: Errand, there: dict[str, Message]) -> list[list[Job]]:
        del self._errands[errand.key]
        if errand.future.status != "finished":
            if errand.address in there and errand.future.status == "error":
                self._refuse(errand.address, there[errand.address], str(errand.future.exception()))
            return self._sweep.groups(list(errand.left.values()))
        returned = errand.future.result()
        if failed := returned.get("failed"):
            self._refuse(errand.address, there.get(errand.address, {"about": {}}), failed)
        for name, data in returned.get("files", {}).items():
            _write(self._sweep.folder.folder, name, data)
        return self._sweep.groups(list(errand.left.values()))

    def _lost(self, there: dict[str, Message]) -> list[list[Job]]:
        """Groups of workers that have vanished; the case that was at work comes alone, and last."""
        found = []
        gone = [e for e in self._errands.values() if e.address not in there]
        for errand in gone:
            if not self._heard.empty():
                return []  # first what it had said
            del self._errands[errand.key]
            errand.future.cancel()
            self._say(f"worker {errand.address} was lost; {len(errand.left)} cases go to others")
            left = list(errand.left.values())
            if left:
                self._sweep.died_at(errand.left.get(errand.at, left[0]), LOST)
            found += self._sweep.groups([job for job in left if not self._sweep.given_up(job)])
        return found


def _means(selector: str, driver: str, info: DeviceInfo) -> bool:
    return selector.lower() == driver or matches(info, selector)


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(PIECE):
            digest.update(piece)
    return digest.hexdigest()


def _write(folder: Path, name: str, data: bytes) -> None:
    """Write a file that a worker has made beside its tables; only where such files belong."""
    path = folder / name
    if not RETURNED.fullmatch(name) or any(p.is_symlink() for p in path.parents[: name.count("/")]):
        raise ResultError(f"{name}: a worker returned a file that no run makes, or a link is there")
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path, "wb") as file:
        file.write(data)
