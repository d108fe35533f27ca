"""Shares out checks to processes; one that crashes or hangs costs the check it was at, no more."""

from __future__ import annotations

import itertools
import multiprocessing
import signal
import tempfile
import time
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from freepath.checks.model import Check
from freepath.checks.outcome import CRASHED, TIMEOUT, Outcome
from freepath.checks.worker import Setting, serve
from freepath.errors import DeviceError

STARTING_S = 120.0
"""After which a process that has not opened its device yet is given up."""


@dataclass(frozen=True)
class Task:
    """A check to run, its number, and which of its repeats it is."""

    number: int
    check: Check
    repeat: int = 0

    def ended(
        self, status: str, seconds: float, text: str, p_value: float | None = None
    ) -> Outcome:
        one = self.check
        return Outcome(
            self.number, one.name, one.labels, status, seconds, text, self.repeat, p_value
        )


class Worker:
    """A process, what it is at, and the folder for what its checks write."""

    def __init__(self, setting: Setting):
        context = multiprocessing.get_context("spawn")
        self.connection, other = context.Pipe()
        # not the process's own: it is killed in the end, and would leave it behind
        self.folder = tempfile.TemporaryDirectory(prefix="freepath-check-")
        given = (other, setting, Path(self.folder.name))
        self.process = context.Process(target=_serve, args=given, daemon=True)
        self.process.start()
        other.close()
        self.ready = False
        self.task: Task | None = None
        self.group: deque[Task] = deque()
        self.since = time.monotonic()

    def start(self, task: Task) -> None:
        self.task, self.since = task, time.monotonic()
        with suppress(BrokenPipeError):  # it has died: that is seen when its answer is read
            self.connection.send((task.check.name, task.repeat))

    def left(self, timeout: float) -> float:
        """Seconds until it has taken too long."""
        allowed = timeout if self.ready else max(timeout, STARTING_S)
        return self.since + allowed - time.monotonic()

    def stop(self) -> None:
        self.connection.close()
        self.process.kill()
        self.process.join()
        self.folder.cleanup()

    def crash(self) -> str:
        self.process.join()
        code = self.process.exitcode or 0
        if code >= 0:
            return f"its process ended with exit code {code}"
        with suppress(ValueError):
            return f"its process was ended by {signal.Signals(-code).name}"
        return f"its process was ended by signal {-code}"


def _serve(connection: Connection, setting: Setting, folder: Path) -> None:
    # Ctrl-C reaches the whole group; the parent ends its workers itself
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(EOFError, BrokenPipeError):
        serve(connection, setting, folder)


@dataclass
class Pool:
    """So many processes for a device."""

    setting: Setting
    processes: int
    timeout: float
    on_start: Any
    """Called with each task as it starts."""
    _groups: deque[deque[Task]] = field(default_factory=deque, init=False)
    _workers: list[Worker] = field(default_factory=list, init=False)

    def outcomes(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        """Run tasks and yield what became of each as it ends; raises DeviceError."""
        groups: dict[str, deque[Task]] = {}
        for task in tasks:
            groups.setdefault(task.check.kernels or task.check.name, deque()).append(task)
        self._groups = deque(groups.values())
        with self._running():
            while self._workers:
                yield from itertools.chain.from_iterable(map(self._step, self._due()))

    @contextmanager
    def _running(self) -> Iterator[None]:
        count = min(self.processes, len(self._groups))
        try:
            self._workers += [Worker(self.setting) for _ in range(count)]
            yield
        finally:
            for worker in self._workers:
                worker.stop()
            self._workers.clear()

    def _due(self) -> list[Worker]:
        """The workers that have something to say, have died or have taken too long."""
        left = max(0.0, min(worker.left(self.timeout) for worker in self._workers))
        heard = wait([worker.connection for worker in self._workers], left)
        return [w for w in self._workers if w.connection in heard or w.left(self.timeout) <= 0]

    def _step(self, worker: Worker) -> Iterator[Outcome]:
        seconds = time.monotonic() - worker.since
        if not worker.connection.poll():
            text = f"stopped after {self.timeout:g} s"
            yield from self._replace(worker, TIMEOUT, seconds, text)
            return
        try:
            answer = worker.connection.recv()
        except (EOFError, OSError):
            yield from self._replace(worker, CRASHED, seconds, worker.crash())
            return
        if worker.ready and worker.task:
            yield worker.task.ended(*answer)
        elif answer:
            raise DeviceError(answer)
        worker.ready = True
        self._next(worker)

    def _next(self, worker: Worker) -> None:
        if not worker.group:
            if not self._groups:
                worker.stop()
                self._workers.remove(worker)
                return
            worker.group = self._groups.popleft()
        task = worker.group.popleft()
        self.on_start(task)
        worker.start(task)

    def _replace(self, worker: Worker, status: str, seconds: float, text: str) -> Iterator[Outcome]:
        worker.stop()
        self._workers.remove(worker)
        if worker.task is None:
            raise DeviceError(f"a process for checks did not start: {text}")
        if worker.group:
            self._groups.appendleft(worker.group)
        if self._groups:
            self._workers.append(Worker(self.setting))
        yield worker.task.ended(status, seconds, text)
