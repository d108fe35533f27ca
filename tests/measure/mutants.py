"""Slips by rule in the kernels and in what the host prepares: which does no check see?

    python tests/measure/mutants.py [--sample N] [--seed S] [--files PART] [--checks N] [--list]

Signs, axes, strides, clamps, counts, channels, comparisons and constants are changed one at a time,
in a copy of the package. Those checks that compose the file are run on it, or build what it
prepares, in a process of their own, until one fails; a slip of the host is shown to its tests too.
A process without an end counts as caught, a slip that does not compile as none. What survives is
printed with its line; exit code 8 where one does that is not among EQUIVALENT.
"""

import argparse
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
HOST = (
    "scene/majorants.py",
    "scene/octree.py",
    "scene/intersect.py",
    "scene/media/grid.py",
    "scene/media/cells.py",
    "scene/lights/sky.py",
    "measure/binding.py",
)
TESTS = [f"tests/scene/test_{name}.py" for name in ("majorants", "intersect", "sky", "grid")]
NUMBER = r"(?<![\w.])\d+\.\d+(?:e-?\d+)?(?![\w.])"
KERNEL_RULES = {
    "sign": [(r"(?<=[\w)\]]) \+ (?=[\w(])", " - "), (r"(?<=[\w)\]]) - (?=[\w(])", " + ")],
    "axis": [(r"\.x\b", ".y"), (r"\.y\b", ".z"), (r"\.z\b", ".x")],
    "stride": [(r"\brow\b", "slice"), (r"\bnx\b", "ny"), (r"\bny\b", "nz"), (r"\bnz\b", "nx")],
    "clamp": [(r"\bsaturate\(", "("), (r"\bsmaller\(", "larger("), (r"\blarger\(", "smaller(")],
    "count": [(r"\bcount\([^;]*\);", ";"), (r"(?<=\w) -= (?=\w)", " -= 2 * ")],
    "channel": [(r"\[c\]", "[0]"), (r", c([,)])", r", 0\1")],
    "comparison": [(r"~less\(", "less("), (r"(?<!~)\bless\(", "~less("), (r" < (?=\w)", " <= ")],
    "constant": [(NUMBER, lambda found: f"{float(found[0]) * 1.01:.9g}")],
}
HOST_RULES = {
    "sign": KERNEL_RULES["sign"],
    "axis": [(r"\[0\]", "[1]"), (r"\[1\]", "[2]"), (r"\[2\]", "[0]"), (r"axis=0", "axis=1")],
    "clamp": [(r"\bminimum\b", "maximum"), (r"\bmaximum\b", "minimum"), (r"\bfloor\b", "ceil"),
              (r"\.min\(", ".max("), (r"\.max\(", ".min("), (r"\bnp\.min\b", "np.max")],
    "comparison": [(r" < (?=\w)", " <= "), (r" <= (?=\w)", " < "), (r" > (?=\w)", " >= ")],
    "constant": [(NUMBER, lambda found: repr(float(found[0]) * 1.01))],
    "count": [(r"(?<=\w) \+ 1\b", " + 2"), (r"(?<=\w) - 1\b", " - 2")],
}  # fmt: skip
EQUIVALENT: dict[tuple[str, str], str] = {}
"""(file, the line as it is then): why nothing can see it."""
SECONDS = 60
"""Of the CPU, after which a check has no end: what passes takes a few."""


FIRST = {
    "score": ("hard/accumulation", "hard/loose/step-cap", "hard/long-runs", "hard/channels"),
    "light": ("hard/scattering/moments", "hard/scattering/sky", "hard/p_absorb", "hard/scattering"),
    "lanes": ("hard/random-numbers", "hard/contrast/half-values"),
    "math": ("hard/random-numbers", "inversion"),
    "media": ("lookups/as-derived", "hard/geometry", "inversion", "hard/contrast"),
    "walk": ("lookups/as-derived", "hard/geometry"),
}
"""By folder, the checks that know most of it: they are run first."""


class Slip(NamedTuple):
    """A line of a file below the package's folders, and what it becomes by a rule."""

    rule: str
    file: str
    line: int
    old: str
    new: str

    @property
    def said(self):
        return f"{self.rule:10} {self.file}:{self.line}: {self.old.strip()}  ->  {self.new.strip()}"


def slips():
    """All of them, in the order of files and lines."""
    kernels = sorted((ROOT / "kernels").rglob("*.cl"))
    for path in kernels:
        yield from _of(path, KERNEL_RULES, r"\A\s*/\*---.*?---\*/|/\*.*?\*/|#define FAR.*")
    for name in HOST:
        yield from _of(ROOT / "harness/freepath" / name, HOST_RULES, r'""".*?"""|#[^\n]*|"[^"\n]*"')


def _of(path, rules, silent):
    text = path.read_text("utf-8")
    blank = re.sub(silent, lambda found: re.sub(r"[^\n]", "~", found[0]), text, flags=re.DOTALL)
    name = str(path.relative_to(ROOT))
    for number, (line, seen) in enumerate(
        zip(text.splitlines(), blank.splitlines(), strict=True), 1
    ):
        if seen.startswith(("from ", "import ", "#", "def ", "class ", "    def ", "static ")):
            continue
        for rule, patterns in rules.items():
            for old, new in patterns:
                for found in re.finditer(old, seen):
                    changed = (
                        line[: found.start()] + found.expand(new)
                        if isinstance(new, str)
                        else (line[: found.start()] + new(found))
                    )
                    changed += line[found.end() :]
                    if changed != line:
                        yield Slip(rule, name, number, line, changed)


def covering():
    """The sources that each check begins with: {check's name: text}."""
    from freepath.checks import registry
    from freepath.checks.rig import Rig
    from freepath.compose import catalog
    from freepath.device.selection import one_device

    class Seen(Exception):
        pass

    class Looking(Rig):
        def program(self, text):
            raise Seen(text.text)

    known, found = catalog.load(), {}
    with tempfile.TemporaryDirectory() as folder:
        rig = Looking(one_device([]), known, Path(folder))
        for check in registry.checks(known):
            if check.in_tests and not check.reason_against(rig.device.info):
                try:
                    check.run(rig, 1e-6)
                except Seen as seen:
                    found[check.name] = str(seen)
                except Exception:  # what cannot be made on this device
                    continue
    return found


def checks_of(slip, texts, order):
    """Those that compose the file, or of the host all that fly through cells; counts first."""
    if slip.file.startswith("kernels/"):
        name = slip.file.removeprefix("kernels/")
        body = (ROOT / slip.file).read_text("utf-8").rpartition("---*/")[2].strip()[:300]
        names = [one for one, text in texts.items() if f'"{name}"' in text or body in text]
    else:
        names = [one for one, text in texts.items() if "majorant_data" in text]
    order.shuffle(names)
    tracker = f"/{Path(slip.file).stem}"
    first = FIRST.get(Path(slip.file).parts[1], ("lookups/as-derived", "identity"))
    return sorted(names, key=lambda one: (tracker not in one, not one.startswith(first)))


def ended(slip, names, folder):
    """What became of a slip: 'survives', 'no program', or who caught it."""
    path = folder / slip.file
    text = (ROOT / slip.file).read_text("utf-8")
    lines = text.splitlines(keepends=True)
    lines[slip.line - 1] = lines[slip.line - 1].replace(slip.old, slip.new)
    path.write_text("".join(lines))
    shared = {"FREEPATH_CACHE": str(folder / "cache"), "POCL_CACHE_DIR": str(folder / "pocl")}
    environment = os.environ | shared | {"PYTHONPATH": str(folder / "harness")}
    try:
        found = _run([__file__, "--child", *names], environment)
        said = found.stdout.splitlines()
        if found.returncode == -signal.SIGPROF:
            return "no end"
        who = said[-1] if said else "a crash"
        if who == "survives" and slip.file.startswith("harness/"):
            tests = ["-m", "pytest", "-qx", "-p", "no:cacheprovider", *TESTS]
            who = "the tests" if _run(tests, environment).returncode else who
        return who
    finally:
        path.write_text(text)


def _run(arguments, environment):
    command = [sys.executable, "-B", *arguments]
    return subprocess.run(
        command, env=environment, cwd=ROOT, check=False, capture_output=True, text=True
    )


def child(names):
    """Run checks until one fails, and print its name."""
    from freepath.checks import registry
    from freepath.checks.model import LEVEL
    from freepath.checks.rig import Rig
    from freepath.checks.verdict import NotApplicable
    from freepath.compose import catalog
    from freepath.device.selection import one_device
    from freepath.errors import BuildError

    known = catalog.load()
    checks = {check.name: check for check in registry.checks(known)}
    with tempfile.TemporaryDirectory() as folder:
        rig = Rig(one_device([]), known, Path(folder))
        for name in names:
            # ends the process, also where a kernel does not return
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            try:
                checks[name].run(rig, LEVEL)
            except NotApplicable:
                continue
            except BuildError:
                print("no program")
                return
            except Exception:  # whatever a wrong program leads to
                print(name)
                return
    print("survives")


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--sample", type=int, default=150, help="how many (default: 150)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--files", default="", help="only those whose name has this part")
    parser.add_argument("--checks", type=int, default=None, help="at most so many of each")
    parser.add_argument("--list", action="store_true", help="list them and run none")
    parser.add_argument("--child", nargs="+", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        child(given.child)
        return 0
    order = random.Random(given.seed)
    chosen = [slip for slip in slips() if given.files in slip.file]
    # as many of each rule, as far as there are so many
    order.shuffle(chosen)
    turns = Counter()
    turn = {slip: turns.update([slip.rule]) or turns[slip.rule] for slip in chosen}
    chosen.sort(key=turn.get)
    if given.list:
        print(*(slip.said for slip in chosen), sep="\n")
        return 0
    texts, found, missed = covering(), Counter(), 0
    with tempfile.TemporaryDirectory(prefix="freepath-mutants-") as name:
        folder = Path(name)
        for part in ("harness", "kernels"):
            ignore = shutil.ignore_patterns("__pycache__", "*.egg-info")
            shutil.copytree(ROOT / part, folder / part, ignore=ignore)
        for slip in chosen:
            if sum(found.values()) >= given.sample:
                break
            names = checks_of(slip, texts, order)[: given.checks]
            if not names:
                continue
            who = ended(slip, names, folder)
            if who == "no program":
                continue
            equivalent = EQUIVALENT.get((slip.file, slip.new.strip()))
            if who == "survives" and equivalent:
                who = "equivalent"
            found[slip.file.partition("/")[0], "caught" if "/" in who or " " in who else who] += 1
            missed += who == "survives"
            print(f"{who:45} {slip.said}{f'  ({equivalent})' if equivalent else ''}", flush=True)
    for (part, what), count in sorted(found.items()):
        print(f"{part}: {count} {what}")
    return 8 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
