"""`freepath ab`: the order of turns, what a side is, and that it judges as `compare` does."""

import numpy as np
import pytest

from freepath.cli import main, parser
from freepath.commands import ab
from freepath.errors import UsageError
from freepath.show import compare
from freepath.show.compare.pairing import Run, Side
from support.runs import modelled, write

TURNS = 4
TELLING = "--factor", "10%", "--drift", "2"
FAKE = """
import pathlib, shutil, sys
side, out = pathlib.Path(__file__).parents[2], pathlib.Path(sys.argv[-1].split("=", 1)[1])
with (side.parent / "order").open("a") as file:
    file.write(f"{side.name} {out.parent.name}/{out.name}\\n")
shutil.copytree(side / "runs" / out.name, out)
if (side / "fails").exists():
    sys.exit("freepath: something is wrong")
"""
"""A checkout whose runs were made before."""


def checkout(folder, seed, factors=()):
    """One whose cases take so many times as long."""
    package = folder / "harness" / "freepath"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "__main__.py").write_text(FAKE)
    random = np.random.default_rng(seed)
    for number in range(1, TURNS + 1):
        run = modelled(random, rounds=40)
        for key, factor in zip(run.times, factors, strict=False):
            run.times[key] = {place: factor * time for place, time in run.times[key].items()}
        write(folder / "runs" / str(number), run)
    return folder


@pytest.fixture
def call(work, capsys):
    def call(*arguments):
        code = main(["ab", "quick", "--turns", str(TURNS), *arguments])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


def test_turns_alternate_and_are_judged_by_the_words_of_compare(call, work):
    checkout(work / "old", 1)
    checkout(work / "new", 2, factors=(1.0, 1.2))
    checkout(work / "same", 4)
    code, out, err = call("--before", "old", "--after", "new", "-o", "out")
    assert code == 1
    assert "SLOWER     transmittance/m/c1/auto/strict" in out
    assert out.count("SLOWER") == 2  # that case, and the totals
    order = (work / "order").read_text().split("\n")[:-1]
    assert [line.split()[0] for line in order] == ["old", "new", "new", "old"] * (TURNS // 2)
    assert order[2] == "new after/2"
    assert "turn 2 of 4: after, new" in err
    code, out, _ = call("--before", "old", "--after", "same", "-o", "aa", *TELLING)
    assert (code, out.splitlines()[-1].split(": ")[1]) == (0, "8 SAME")
    assert main(["compare", "aa/before", "aa/after", *TELLING]) == 0


def test_a_slowdown_of_all_cases_is_found(call, work):
    """Of single runs nobody knows whether the machine or all of the code became slower."""
    checkout(work / "old", 1)
    checkout(work / "new", 2, factors=[1.5] * 8)
    code, out, _ = call("--before", "old", "--after", "new", "-o", "out")
    assert (code, out.splitlines()[-1].split(": ")[1]) == (1, "8 SLOWER")


def test_a_turn_that_fails_ends_it_with_its_last_words(call, work):
    checkout(work / "old", 1)
    (checkout(work / "new", 1) / "fails").touch()
    code, _, err = call("--before", "old", "--after", "new", "-o", "out")
    assert code == 8
    assert "after/1: the turn ended with exit code 1: freepath: something is wrong" in err
    code, _, err = call("--before", "old", "--after", "new", "-o", "out")
    assert (code, "out: expected a folder that is empty" in err) == (2, True)


def test_what_a_side_is(work):
    (work / "mine").mkdir()
    (work / "mine.cl").touch()
    checkout(work / "old", 1)
    kinds = {"mine": "trackers", "mine.cl": "trackers", "old": "checkout", "intel": "device"}
    assert {ref: ab.kind_of(ref) for ref in kinds} == kinds
    for wrong in ("./nothing", "nothing.cl"):
        with pytest.raises(UsageError, match=f"{wrong}: expected a checkout, a folder"):
            ab.kind_of(wrong)
    asked = ["--before", "x", "--after", "y", "-a", "tightness=1", "-R", "delta", "-d", "3.0"]
    options = parser().parse_args(["ab", "quick", *asked, "--trackers", "more"])
    of = {ref: ab.command_of(options, work / "c.yaml", ref, kind) for ref, kind in kinds.items()}
    shared = ["run", str(work / "c.yaml"), "--axis=tightness=1", "--include=delta"]
    shared += [f"--trackers={work / 'more'}"]
    for ref, (words, path) in of.items():
        own = [f"--trackers={work / ref}"] if kinds[ref] == "trackers" else []
        device = "intel" if ref == "intel" else "3.0"
        assert words[2:] == ["freepath", *shared, *own, f"--device={device}"]
        assert path == (str(work / "old" / "harness") if ref == "old" else "")
        parser().parse_args(words[3:])  # which `freepath run` takes


def test_two_of_a_kind_are_compared(call, work):
    (work / "mine.cl").touch()
    code, _, err = call("--before", "mine.cl", "--after", "intel", "-o", "out")
    told = "mine.cl (files or folders with trackers) and intel (devices)"
    assert (code, told in err) == (2, True)
    with pytest.raises(SystemExit):
        call("--before", "a", "--after", "b", "--turns", "2")


def test_devices_are_compared_case_by_case():
    """As if both were one; what is found is what is found on one device."""
    random = np.random.default_rng(5)
    runs = [modelled(random, rounds=40) for _ in range(2 * TURNS)]
    before, after = Side("a", runs[:TURNS]), Side("b", runs[TURNS:])
    for run in after.runs:
        first = next(iter(run.times))
        run.times[first] = {place: 1.3 * time for place, time in run.times[first].items()}
    elsewhere = [
        Run(*({(key[0], "e", "q"): x for key, x in part.items()} for part in parts), run.host)
        for run in after.runs
        for parts in [(run.rows, run.times, run.variances)]
    ]
    moved = compare.on_device_of(before, Side("b", elsewhere))
    settings = compare.Settings()
    found, same = (compare.comparison(before, side, settings) for side in (moved, after))
    assert [one.verdict for one in found.judged] == [one.verdict for one in same.judged]
    assert found.verdicts["SLOWER"] == 1
    two = Side("b", [elsewhere[0], runs[0]])
    with pytest.raises(
        Exception, match="expected a device on either side, got d / p, d / p, e / q"
    ):
        compare.on_device_of(before, two)
