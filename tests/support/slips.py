"""Slips of a hand in a new tracker, each with a check that must see it.

`python tests/support/slips.py [DEVICE [PART]]` gives the right tracker and each wrong one to
`freepath try` and prints a table of what that says and which checks failed. It takes about half a
minute each.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

RIGHT = (Path(__file__).parents[1] / "data" / "ratio_roulette.cl").read_text("utf-8")
NAME = "newcomer"
NULL = "(sigma_n / path->majorant)"
GIVEN = "(Path *path, const Scene *scene, Rng *rng"
DECIDES = f"static void at_tentative{GIVEN}, const mask here, const real sigma_t)\n{{"
BEGINS = f"static void begin{GIVEN}) {{ walk_begin(path, scene); }}\n\n"
STEPS = f"static void step{GIVEN})\n{{"
ALL = f"identity/{NAME}/transmittance/"
TOO_LOW = f"hard/non-bounding/0.5/{NAME}"


class Slip(NamedTuple):
    """What it is, what changes in the file (or its whole function), and a check that fails."""

    what: str
    changes: tuple[tuple[str, str], ...]
    check: str
    instead: str = ""

    @property
    def text(self) -> str:
        """The wrong tracker."""
        text = RIGHT
        if self.instead:
            text = f"{text.partition(DECIDES)[0]}{self.instead.strip()}\n}}\n"
        for old, new in self.changes:
            assert text.count(old) == 1, (self.what, old)
            text = text.replace(old, new)
        return text


SLIPS = (
    Slip(
        "a weight too small by 1 %",
        ((NULL, f"(SCALAR)0.99 * {NULL}"),),
        ALL + "trilinear/grid",
    ),
    Slip(
        "a null probability with the wrong denominator",
        ((NULL, "(sigma_n / (path->majorant + sigma_n))"),),
        ALL + "trilinear/grid",
    ),
    Slip(
        "survivors of the roulette that are not divided by their chance",
        (("weight / survival, weight", "weight, weight"),),
        ALL + "trilinear/grid",
    ),
    Slip(
        "a sign that is lost",
        ((f"path->weight * {NULL}", f"path->weight * fabs{NULL}"),),
        TOO_LOW,
    ),
    Slip(
        "a null coefficient that is clamped at 0",
        ((NULL, f"saturate{NULL}"),),
        TOO_LOW,
    ),
    Slip(
        "the majorant of the first collision at all of them",
        (
            ("parameters:", "state: {first: real}\nparameters:"),
            (DECIDES, BEGINS.replace("; }", "; path->state.first = (real)0; }") + DECIDES),
            (
                f"    const real weight = path->weight * {NULL};",
                "    const mask unknown = here & equal(path->state.first, (real)0);\n"
                "    path->state.first = choose(unknown, path->majorant, path->state.first);\n"
                "    const real weight = path->weight * (sigma_n / path->state.first);",
            ),
        ),
        ALL + "trilinear/grid",
    ),
    Slip(
        "a uniform number that is used twice",
        (("bounding: false", "bounding: true"),),
        ALL + "trilinear/grid",
        f"""{DECIDES}
    const real u = uniform(rng);
    const mask hit = here & less(u * path->majorant, sigma_t);
    const mask culled = here & ~hit & less((real)0.9, u);
    path->weight = choose(here, path->weight / (SCALAR)0.9, path->weight);
    collide(path, hit | culled);""",
    ),
    Slip(
        "a lookup that is not counted",
        (
            (DECIDES, f"{BEGINS}{STEPS}\n    const mask here = next_tentative(path, scene, rng);"),
            (
                "path->majorant - sigma_t;",
                "path->majorant - sigma_t_at(scene, place_on(&path->ray, path->t).x,\n"
                "        place_on(&path->ray, path->t).y, place_on(&path->ray, path->t).z);",
            ),
        ),
        f"lookups/counted/{NAME}",
    ),
    Slip(
        "a march that claims to be unbiased",
        (
            ("needs: [majorant]", "needs: []"),
            ("{default: 0.1, above: 0, maximum: 1,", "{unit: length, default: 0.1, above: 0,"),
        ),
        ALL + "trilinear/global",
        f"""{BEGINS.replace("walk_begin(path, scene); ", "")}{STEPS}
    const real next = to_real(path->steps) * scene->tracker.threshold;
    const real t_exit = smaller(next, path->ray.length);
    const real sigma = sigma_t(path, scene, path->t, path->live);
    path->weight = choose(path->live, path->weight * exp(sigma * (path->t - t_exit)), path->weight);
    path->t = choose(path->live, t_exit, path->t);
    escape(path, path->live & ~less(t_exit, path->ray.length));""",
    ),
    Slip(
        "delta tracking that claims to need no bound",
        (),
        TOO_LOW,
        f"{DECIDES}\n    collide(path, here & less(uniform(rng) * path->majorant, sigma_t));",
    ),
)


def main(arguments: list[str]) -> int:
    """Try all; 8 where the right one is rejected, or a wrong one is not."""
    device, part = ["-d", *arguments[:1]] if arguments else [], "".join(arguments[1:])
    mistaken = False
    print("| tracker | exit code | checks that fail |\n| --- | --- | --- |")
    for what, text in (("the right one", RIGHT), *((slip.what, slip.text) for slip in SLIPS)):
        if part not in what:
            continue
        with tempfile.TemporaryDirectory() as folder:
            file, output = Path(folder) / f"{NAME}.cl", Path(folder) / "out"
            file.write_text(text)
            command = [sys.executable, "-m", "freepath", "try", str(file), "-o", str(output)]
            ended = subprocess.run(
                [*command, "--checks-only", *device], capture_output=True, check=False
            )
            outcomes = json.loads((output / "checks.json").read_text())
        wrong = [one["name"] for one in outcomes if one["status"] not in ("Passed", "Skipped")]
        mistaken |= (ended.returncode != 8) != (text == RIGHT)
        named = ", ".join(f"`{name}`" for name in wrong[:3])
        more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
        print(f"| {what} | {ended.returncode} | {named}{more} |", flush=True)
    return 8 if mistaken else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
