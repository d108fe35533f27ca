"""A sweep in a process of its own, that is watched: what ends or hangs it costs one case its row.

`python -m freepath.measure.worker` is that process. It sees one driver, holds the devices and
writes the folder. What it is at stands in two numbers that both processes share, and that the
watching one looks at a few times a second: nothing wakes it while a kernel is timed.
"""

from __future__ import annotations

import mmap
import os
import pickle
import signal
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import cloudpickle
import numpy as np

from freepath.device import drivers
from freepath.device.drivers import Driver
from freepath.device.opencl import DeviceInfo, open_devices
from freepath.device.selection import Part, selector_of
from freepath.errors import DeviceError, FreepathError, ResultError, RunError
from freepath.measure.sweep import Listener, Sweep
from freepath.results.folder import ResultFolder

LOOK_S = 0.25
"""Between two looks at what the process is at, and between two reports of its progress."""
ENDING_S = 2.0
"""Within which it ends when it is interrupted."""
BUILDING_S, BUDGETS = 60.0, 20.0
"""What a build or a launch may take at most: so many seconds, and so many budgets of its case."""
INTERPRETED = 10.0
"""So many times that where a command in front interprets kernels."""


def run(sweep: Sweep, part: Part, timeout_s: float | None = None) -> None:
    """Run a sweep on devices of one driver; what it tells its listener and its clock arrives here.

    A case at which the process ends, or whose build or launch takes longer than timeout_s (default:
    60 s and 20 times its at_most), is tried once more, last and alone; if that happens again its
    row says so. Raises what the sweep raises, and RunError where no case was at work.
    """
    while _ends_early(sweep, part.driver, part.infos, timeout_s):
        folder = sweep.folder
        sweep.folder = ResultFolder(folder.folder, resume=folder.holds_rows, confirm=sweep.confirm)


def limit_of(sweep: Sweep, number: int, driver: Driver) -> float:
    """Seconds that a build or a launch of a case may take where nothing else is said."""
    at_most = sweep.cases[number % len(sweep.cases)].stop.at_most
    return (BUILDING_S + BUDGETS * at_most) * (INTERPRETED if driver.prefix else 1.0)


def _ends_early(
    sweep: Sweep, driver: Driver, infos: Sequence[DeviceInfo], timeout_s: float | None
) -> bool:
    """Run a process to its end; tells whether a case has ended it, which is noted then."""
    here, there = Pipe()
    memory = os.memfd_create("freepath")
    os.ftruncate(memory, mmap.PAGESIZE)
    state = np.frombuffer(mmap.mmap(memory, mmap.PAGESIZE), np.float64)
    state[:2] = sweep.state = np.array([0.0, -1.0])
    killed, hung = out_of_memory_kills(), 0.0
    words = ["freepath.measure.worker", str(there.fileno()), str(memory)]
    given = (there.fileno(), memory)
    with here, drivers.started(driver, words, pass_fds=given) as process:
        there.close()
        os.close(memory)
        try:
            listener, sweep.listener = sweep.listener, Listener()
            work = cloudpickle.dumps((sweep, [selector_of(info) for info in infos]))
            sweep.listener = listener
            with suppress(BrokenPipeError):  # it has died, which is seen below
                here.send_bytes(work)
            while True:
                try:
                    if here.poll(LOOK_S) and _heard(here, sweep):
                        return False
                except (EOFError, ConnectionResetError):
                    break
                since, number = state[:2]
                sweep.listener.look(int(number))
                limit = timeout_s or limit_of(sweep, int(number), driver)
                if since and time.monotonic() - since > limit:
                    hung = limit
                    break
        except KeyboardInterrupt:
            process.terminate()
            _ended_in_order(here, sweep)
            raise
        if hung:
            os.killpg(process.pid, signal.SIGKILL)
        code = process.wait()
    verdict, number = _verdict(code, hung, out_of_memory_kills() != killed), int(state[1])
    if number < 0:
        raise RunError(f"{driver.name}: {verdict['reason']} before a case was at work")
    sweep.deaths.setdefault(number, []).append(verdict)
    return True


def _heard(here: Connection, sweep: Sweep) -> bool:
    """Take in what the process says; tells whether the sweep has ended."""
    kind, said, sweep.total, sweep.ended, sweep.clock.build_s, sweep.clock.device_s = here.recv()
    if kind == "raised":
        raise said
    if kind != "ended":
        getattr(sweep.listener, kind)(*said)
    return kind == "ended"


def _ended_in_order(here: Connection, sweep: Sweep) -> None:
    """Wait until an interrupted process has told that it leaves all in order; not for ever."""
    until = time.monotonic() + ENDING_S
    with suppress(EOFError, OSError, KeyboardInterrupt):
        while here.poll(max(0.0, until - time.monotonic())):
            _heard(here, sweep)


def _verdict(code: int, hung: float, for_memory: bool) -> dict[str, str]:
    """Status and reason of a case at which a process ended twice.

    Who has sent SIGKILL is not known: this process after a timeout, the kernel for want of memory,
    which it counts, or somebody else, a batch system or a daemon. That is no fault of the case, so
    its row does not stand when a run goes on.
    """
    if hung:
        return {
            "status": "timeout",
            "reason": f"a build or a launch did not end within {hung:g} s (--timeout)",
        }
    reason = drivers.how_it_ended(code)
    if code == -signal.SIGKILL and not for_memory:
        reason += ", by whom is not known: by the system for want of memory, or from outside"
        return {"status": "run_failed", "reason": reason}
    if code == -signal.SIGKILL:
        reason += " for want of memory, as the system counted such an end meanwhile"
    return {"status": "crashed", "reason": reason}


def out_of_memory_kills() -> int | None:
    """How many processes the kernel has ended for want of memory; None where it does not say."""
    with suppress(OSError, ValueError):
        lines = Path("/proc/vmstat").read_text("ascii").splitlines()
        return next((int(line.split()[1]) for line in lines if line.startswith("oom_kill ")), None)
    return None


class Telling(Listener):
    """Hands on what a sweep reports, its progress only now and then."""

    def __init__(self, there: Connection, sweep: Sweep):
        self._there, self._sweep = there, sweep
        self._what, self._next = "", 0.0

    def tell(self, kind: str, said: Any = ()) -> None:
        """Say one thing, and how far the sweep is."""
        one = self._sweep
        self._there.send((kind, said, one.total, one.ended, one.clock.build_s, one.clock.device_s))

    def row(self, row: dict[str, Any]) -> None:
        self.tell("row", (row,))

    def rounds(self, *kinds: list[dict[str, Any]]) -> None:
        if self._sweep.tells_rounds:
            self.tell("rounds", kinds)

    def progress(self, done: float, total: int, what: str) -> None:
        what, now = what.partition(" ")[0], time.monotonic()
        if what != self._what or now >= self._next:
            self._what, self._next = what, now + LOOK_S
            self.tell("progress", (done, total, what))


def main(words: Sequence[str]) -> int:
    """Run the sweep that comes over the connection of this number."""
    connection, memory = map(int, words)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _interrupt)
    with suppress(OSError):  # of two that take memory, this one is to go
        Path("/proc/self/oom_score_adj").write_text("500")
    there = Connection(connection)
    sweep, selectors = pickle.loads(there.recv_bytes())
    threading.Thread(target=_end_with_parent, args=[there], daemon=True).start()
    sweep.state = np.frombuffer(mmap.mmap(memory, mmap.PAGESIZE), np.float64)
    sweep.listener = telling = Telling(there, sweep)
    try:
        _open(sweep, selectors)
        sweep.run()
    except (FreepathError, KeyboardInterrupt) as error:
        telling.tell("raised", error)
    except MemoryError:
        telling.tell("raised", RunError("out of memory"))
    except OSError as error:
        told = f"{error.filename or 'writing'}: {error.strerror}"
        telling.tell("raised", ResultError(told))
    else:
        telling.tell("ended")
    return 0


def _end_with_parent(there: Connection) -> None:
    """It must not go on alone, taking the processor and holding the folder's lock."""
    with suppress(EOFError, OSError):
        there.recv_bytes()
    os._exit(1)


def _interrupt(signum: int, frame: Any) -> None:
    raise KeyboardInterrupt


def _open(sweep: Sweep, selectors: Sequence[str]) -> None:
    try:
        sweep.devices = [open_devices([one])[0] for one in selectors]
    except DeviceError as error:
        hint = "`freepath devices` tries what works now"
        raise RunError(f"{error}; {hint}") from error


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
