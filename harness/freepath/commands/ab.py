"""`freepath ab`: two trackers' folders, devices or checkouts in turns, and what that shows."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from argparse import ArgumentTypeError, Namespace
from contextlib import suppress
from pathlib import Path
from typing import Any

from freepath.commands.arguments import add_config, add_device, add_output
from freepath.commands.compare import add_judging, judge
from freepath.errors import FAILED, FreepathError, UsageError

ENDING_S = 20.0
"""Within which a turn ends that is interrupted."""
LEAST = 3
"""Turns of a side from which it is judged by how much they differ: compare's LEAST_RUNS."""
KINDS = {
    "checkout": "checkouts of freepath",
    "trackers": "files or folders with trackers",
    "device": "devices",
}


def add(commands: Any) -> None:
    """Declare its arguments."""
    ab = commands.add_parser(
        "ab",
        help="measure two sides in turns, and compare them",
        description="Run a config in turns with one and with the other of two checkouts of "
        "freepath, folders with trackers, or devices, and compare the turns as `freepath compare` "
        "compares runs. What a drifting machine does to one side it does to the other.",
        epilog="exit codes: 0 no verdict of --fail-on; 1 one of them; 2 usage; 8 a turn failed; "
        "130 interrupted",
        allow_abbrev=False,
    )
    add_config(ab)
    for name in ("before", "after"):
        told = "a checkout of freepath, a file or folder with trackers, or what -d takes"
        ab.add_argument(f"--{name}", required=True, metavar="REF", help=told)
    ab.add_argument(
        "--turns",
        type=_turns,
        default=5,
        metavar="N",
        help=f"runs of the whole config on each side, {LEAST} at least (default: 5)",
    )
    add_device(ab, "what both sides run on, where they are no devices")
    add_output(ab, "the runs of both sides", "ab-NAME", into="folder")
    add_judging(ab)
    ab.set_defaults(output=None)


def _turns(text: str) -> int:
    if not (text.isascii() and text.isdigit() and LEAST <= int(text) <= 1000):
        raise ArgumentTypeError(f"expected a number of turns from {LEAST} to 1000, got '{text}'")
    return int(text)


def kind_of(ref: str) -> str:
    """What a side is, by what stands there; raises UsageError for a path with nothing there."""
    path = Path(ref)
    if (path / "harness" / "freepath" / "__main__.py").is_file():
        return "checkout"
    if path.exists():
        return "trackers"
    if os.sep in ref or path.suffix == ".cl":
        raise UsageError(f"{ref}: expected a checkout, a folder or file with trackers, or a device")
    return "device"


def command_of(options: Namespace, config: Path, ref: str, kind: str) -> tuple[list[str], str]:
    """The command of a turn, without its folder, and the folder that Python is to look into."""
    given = [f"--axis={one}" for one in options.axis]
    given += [f"--include={options.include}"] if options.include else []
    given += [f"--exclude={options.exclude}"] if options.exclude else []
    folders = [*options.trackers, *([Path(ref)] if kind == "trackers" else [])]
    given += [f"--trackers={folder.resolve()}" for folder in folders]
    devices = [ref] if kind == "device" else options.device
    given += [f"--device={device}" for device in devices]
    start = [sys.executable, "-m", "freepath", "run", str(config.resolve()), *given]
    return start, str(Path(ref).resolve() / "harness") if kind == "checkout" else ""


def turn(command: list[str], checkout: str, folder: Path) -> None:
    """Run one turn, what it prints into a file beside its folder; raises FreepathError."""
    paths = [checkout, os.environ.get("PYTHONPATH", "")]
    variables = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
    log = folder.with_suffix(".log")
    words = [*command, f"--output={folder}"]
    with (
        log.open("w", encoding="utf-8") as file,
        subprocess.Popen(
            words, stdout=file, stderr=file, env=variables, start_new_session=True
        ) as process,
    ):
        try:
            code = process.wait()
        except KeyboardInterrupt:
            process.send_signal(signal.SIGINT)  # once: in its own session no Ctrl-C reaches it
            with suppress(subprocess.TimeoutExpired):
                process.wait(ENDING_S)
            raise
    if code in (0, FAILED) and (folder / "summary.csv").is_file():
        return  # a case that failed is judged
    last = next(iter(log.read_text("utf-8", "replace").strip().splitlines()[-1:]), "nothing")
    told = FreepathError(
        f"{folder}: the turn ended with exit code {code}: {last} (all of it: {log})"
    )
    told.exit_code = FAILED
    raise told


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    from freepath import config as configs
    from freepath.results.folder import new_folder
    from freepath.show import compare

    refs = {"before": options.before, "after": options.after}
    kinds = {side: kind_of(ref) for side, ref in refs.items()}
    if len(set(kinds.values())) > 1:
        told = " and ".join(f"{refs[side]} ({KINDS[kind]})" for side, kind in kinds.items())
        raise UsageError(f"--before, --after: expected two of a kind, got {told}")
    path = configs.find(options.config)
    base = (options.folder or new_folder(f"ab-{path.stem}")).resolve()
    if base.exists() and any(base.iterdir()):
        raise UsageError(f"{base}: expected a folder that is empty or not there yet")
    base.mkdir(parents=True, exist_ok=True)
    print(f"runs of both sides go into {base}", file=sys.stderr)
    for number in range(options.turns):
        # before, after, after, before: what drifts steadily is the same for both
        for side in ("before", "after") if number % 2 == 0 else ("after", "before"):
            print(f"turn {number + 1} of {options.turns}: {side}, {refs[side]}", file=sys.stderr)
            folder = base / side / str(number + 1)
            folder.parent.mkdir(exist_ok=True)
            turn(*command_of(options, path, refs[side], kinds[side]), folder)
    before, after = (compare.load(base / side) for side in refs)
    if kinds["after"] == "device":
        after = compare.on_device_of(before, after)
    return judge(options, before, [after], same_samples=kinds["after"] == "checkout")
