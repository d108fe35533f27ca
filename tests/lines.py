"""How many lines each part has, beside the most that it may have: `python tests/lines.py`.

Lines of Python in the package, of OpenCL C in kernels/; exit code 1 where a part has more. Who
needs more raises the number here, in the same commit, and says why.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "harness" / "freepath"
BUDGET = {
    "checks": 5220,
    "kernels": 3600,
    "scene": 3565,
    "show": 3865,
    "measure": 3230,
    "config": 2135,
    "commands": 1965,
    "device": 1410,
    "compose": 1000,
    "results": 850,
    "extras": 1395,
    "modules on the first floor": 510,
    "cases": 320,
}


def counted():
    """The lines of each part: a folder or a module of the package, and kernels."""
    parts = {}
    for path in PACKAGE.rglob("*.py"):
        name = path.relative_to(PACKAGE).with_suffix("").parts[0]
        parts[name] = parts.get(name, 0) + len(path.read_text("utf-8").splitlines())
    single = [name for name in parts if (PACKAGE / f"{name}.py").is_file()]
    parts["modules on the first floor"] = sum(parts.pop(name) for name in single)
    kernels = (ROOT / "kernels").rglob("*.cl")
    parts["kernels"] = sum(len(path.read_text("utf-8").splitlines()) for path in kernels)
    return parts


def main():
    """Print the table; 1 where a part is over."""
    found = counted()
    over = [name for name in found if found[name] > BUDGET.get(name, 0)]
    for name in sorted(found | BUDGET, key=lambda name: -found.get(name, 0)):
        said = "   more than it may have" if name in over else ""
        print(f"{name:28}{found.get(name, 0):6} of {BUDGET.get(name, 0):5}{said}")
    print(f"{'Python':28}{sum(found.values()) - found['kernels']:6}")
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())
