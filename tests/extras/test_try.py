"""`freepath try`: a right tracker is accepted, wrong ones are rejected by name."""

import json
import math
import re

import pytest

import freepath
from freepath.checks import registry
from freepath.checks.model import LEVEL
from freepath.checks.outcome import Outcome
from freepath.checks.verdict import Failure
from freepath.cli import main
from freepath.compose import catalog
from freepath.errors import CatalogError
from freepath.extras import candidate
from freepath.results.folder import COLUMNS
from support.slips import BEGINS, DECIDES, NAME, RIGHT, SLIPS, STEPS

pytestmark = pytest.mark.slow

KEY = "threshold: {default"


@pytest.fixture
def file(work):
    path = work / f"{NAME}.cl"
    path.write_text(RIGHT)
    return path


@pytest.fixture
def call(work, capsys, selector):
    def call(*arguments):
        code = main(["try", *map(str, arguments), "-d", selector])
        captured = capsys.readouterr()
        return code, captured.out + captured.err

    return call


def checks(file):
    known, tracker, _ = candidate.read(file)
    chosen = candidate.checks_of(known, tracker, every=False)
    return known, {check.name: check for _, check in chosen}


@pytest.mark.parametrize("slip", SLIPS, ids=lambda slip: slip.what)
def test_a_wrong_tracker_fails_a_check(rig, file, slip):
    file.write_text(slip.text)
    known, found = checks(file)
    with pytest.raises(Failure):
        found[slip.check].run(rig.with_trackers(known), LEVEL)


def test_the_right_tracker_passes_those_checks(rig, file):
    known, found = checks(file)
    for name in {slip.check for slip in SLIPS} & set(found):
        found[name].run(rig.with_trackers(known), LEVEL)


def test_shipped_trackers_count_their_lookups(rig):
    for check in registry.checks(catalog.load()):
        if check.name in ("lookups/counted/ratio", "lookups/counted/delta"):
            check.run(rig, LEVEL)


def test_accepted_and_measured(call, file, monkeypatch):
    """The whole way, with few checks and a short sweep."""
    few = {"lookups/counted/newcomer", SLIPS[0].check}
    chosen = candidate.checks_of
    monkeypatch.setattr(
        candidate,
        "checks_of",
        lambda *given, every: [one for one in chosen(*given, every=every) if one[1].name in few],
    )
    monkeypatch.setattr(candidate, "RELATIVES", 1)
    monkeypatch.setattr(candidate, "CLOUD", candidate.ATMOSPHERE)
    monkeypatch.setattr(candidate, "STOP", {"samples": 64})
    code, text = call(file, "-o", "out")
    assert code == 0, text
    assert "right: 2 checks passed" in text
    assert "transmittance, exponential-5-0.3, 1024 rays:" in text
    assert re.search("exponential-5-0.3, beside ratio:\n  global, tightness [14]: ", text), text
    page = (file.parent / "out" / "report.html").read_text("utf-8")
    assert NAME in page
    assert "2 checks passed" in page
    assert main(["run", "out/try.yaml", "--trackers", file.name, "-N"]) == 0


def test_what_hangs_may_take_so_long(call, file, monkeypatch):
    from freepath.measure import worker

    given = []

    def measured(sweep, part, timeout_s=None):
        given.append(timeout_s)
        raise KeyboardInterrupt

    monkeypatch.setattr(worker, "run", measured)
    monkeypatch.setattr(candidate, "checks_of", lambda *given, every: [])
    assert call(file, "-o", "out", "--timeout", "7")[0] == 130
    assert given == [7.0]


def test_rejected_with_what_was_measured(call, file, monkeypatch):
    file.write_text(SLIPS[7].text)
    chosen = candidate.checks_of
    monkeypatch.setattr(
        candidate,
        "checks_of",
        lambda *given, every: [
            one for one in chosen(*given, every=every) if "counted" in one[1].name
        ],
    )
    code, text = call(file, "-o", "out")
    assert code == 8
    assert "wrong: 1 of 1 checks failed" in text
    assert "lookups/counted/newcomer" in text
    lines = SLIPS[7].text.splitlines()
    (at,) = (number for number, line in enumerate(lines, 1) if "sigma_t_at(" in line)
    assert f"newcomer.cl:{at}: expected sigma_t" in text
    (one,) = json.loads((file.parent / "out" / "checks.json").read_text())
    assert one["status"] == "Failed"


@pytest.mark.parametrize(
    ("old", "new", "code", "told"),
    [
        ("collide(path", "colide(path", 8, "newcomer.cl"),
        ("const real sigma_n =", "const real sigma_n", 8, "newcomer.cl:14"),
        (
            "void at_tentative(",
            "void at_tentativ(",
            2,
            "newcomer.cl:1:1: expected the functions begin and step, or at_tentative",
        ),
        ("maximum: 1", "maximum: abc", 2, "newcomer.cl:8:48: parameters.threshold.maximum"),
        ("---*/", "*/", 2, "newcomer.cl:1:1: expected front matter"),
        ("needs: [majorant]", "needs: [majorent]", 2, "newcomer.cl:4:9: needs[0]"),
        ("/*---", "/*", 2, "expected front matter"),
        ("estimands: [transmittance]", "estimands: [mean_extinction]", 2, "expected transmittance"),
    ],
)
def test_what_cannot_be_tried(call, file, old, new, code, told):
    file.write_text(RIGHT.replace(old, new, 1))
    found, text = call(file, "-o", "out")
    assert found == code
    assert told in text
    assert "Traceback" not in text


def test_names_and_files(call, file):
    taken = file.with_name("ratio.cl")
    taken.write_text(RIGHT)
    for given, told in (
        (taken, "expected a new name, got 'ratio' again"),
        (file.with_name("none.cl"), "got nothing there"),
        (file.parent, "got a folder"),
    ):
        code, text = call(given)
        assert code == 2
        assert told in text
    code, text = call(file, "--volume", "none.npy")
    assert code == 2
    assert "none.npy: no such file in" in text


def test_relatives_are_those_alike(file):
    known, tracker, _ = candidate.read(file)
    near = [other.name for other in candidate.relatives(known, tracker)[: candidate.RELATIVES]]
    assert "ratio" in near
    assert "march" not in near


def row_of(tracker, time, noise="0.01", tightness="1"):
    row = dict.fromkeys(COLUMNS, "") | {"status": "ok", "medium": "m", "majorant": "global"}
    row |= {"tracker": tracker, "tracker_label": tracker, "tightness": tightness}
    row |= {"time_to_1pct_s": str(time), "time_per_sample_s": "1e-9", "time_noise": "0.01"}
    return row | {"variance_noise": noise, "case": f"{tracker}/{tightness}"}


def test_it_is_compared_with_its_parent_at_equal_majorants():
    rows = [row_of("mine", 1e-3), row_of("ratio", 2e-3), row_of("delta", 1e-9)]
    rows += [row_of("mine", 1e-3, tightness="4"), row_of("ratio", 0.5e-3, tightness="4")]
    assert candidate.beside_parent(rows, "mine", "ratio") == [
        "m, beside ratio:",
        "  global, tightness 1: 2.0 (2.0 to 2.0) times as fast: faster",
        "  global, tightness 4: 0.5 (0.49 to 0.51) times as fast: slower",
    ]
    told = candidate.beside_parent([row_of("mine", 1e-3), row_of("ratio", 1e-3)], "mine", "ratio")
    assert told[1].endswith("no difference is known")
    # a thousand times as fast, of an interval that holds 0; and one that never reaches 1 %
    for other, said in (("1.5", "not known: the variance"), ("0.01", "it never reaches 1 %")):
        own = row_of("mine", 1e-6 if other == "1.5" else math.inf, noise=other)
        (_, told) = candidate.beside_parent([own, row_of("ratio", 1e-3)], "mine", "ratio")
        assert said in told


def test_the_parent_is_named_or_is_the_nearest(file):
    assert candidate.read(file)[2].name == "ratio"
    assert candidate.read(file, "delta")[2].name == "delta"
    file.write_text(RIGHT.replace("needs: [majorant]", "needs: [majorant]\nlike: track_length", 1))
    assert candidate.read(file)[2].name == "track_length"
    assert candidate.read(file, "delta")[2].name == "delta"
    for wrong in ("nobody", NAME, "joint"):
        with pytest.raises(CatalogError, match=f"like: expected one of .*, got {wrong}"):
            candidate.read(file, wrong)


HANGS = STEPS + "\n    path->steps = (index)0;\n}\n"


def test_one_that_hangs_is_found_at_once(call, file, monkeypatch):
    """The smoke check alone is waited for, and the likely cause is told."""
    monkeypatch.setattr(candidate, "SMOKE_S", 1.0)
    head = RIGHT.partition(DECIDES)[0]
    file.write_text(f"{head}{BEGINS}{HANGS}")
    code, text = call(file, "-o", "out")
    assert code == 8, text
    assert "a step never ended a path: does it call escape or collide" in text
    assert "; 1 checks were run" in text
    (one,) = json.loads((file.parent / "out" / "checks.json").read_text())
    assert one["status"] == "Timeout"


@pytest.mark.parametrize("ending", ["escape(path, path->live);", "path->live &= (mask)0;"])
def test_a_path_that_ends_in_begin_is_refused_by_name(call, file, ending):
    begin = BEGINS.replace("; }", f";\n    /* collide( */ {ending} }}")
    head = RIGHT.partition(DECIDES)[0]
    file.write_text(f"{head}{begin}{HANGS}")
    code, text = call(file, "-o", "out")
    assert code == 2
    line = head.count("\n") + 2
    what = "escape" if "escape" in ending else "path->live"
    assert f"{NAME}.cl:{line}:1: expected begin to leave its path flying, got {what} there" in text
    assert not (file.parent / "out").exists()


def test_findings_are_kept_when_it_is_interrupted(call, file, selector, monkeypatch):
    def ended(session, info):
        check = session.chosen[0][1]
        session.outcomes[info.label] = [Outcome(1, check.name, (), "Failed", 1.0, "told", 0, None)]
        if "smoke" not in check.labels:
            raise KeyboardInterrupt

    monkeypatch.setattr(candidate.checking.Session, "run", ended)
    code, text = call(file, "-o", "out")
    assert code == 130, text
    assert "interrupted; 2 checks were run" in text
    assert "wrong: 2 of 2 checks failed" in text
    assert len(json.loads((file.parent / "out" / "checks.json").read_text())) == 2
    trial = freepath.try_tracker(file, output="out", devices=selector)  # its folder is made anew
    assert (trial.interrupted, trial.right, trial.result) == (True, False, None)
    assert (str(trial) + "\n", len(trial.outcomes)) == (text, 2)


def test_a_new_tracker_begins_as_its_parent(work, capsys):
    assert main(["new-tracker", "mine", "--like", "march"]) == 0
    known, tracker, parent = candidate.read(work / "mine.cl")
    assert (tracker.title, parent.name) == ("mine, made from Ray marching", "march")
    assert tracker.parameters == known.trackers["march"].parameters
    assert tracker.code.splitlines()[16:] == known.trackers["march"].code.splitlines()[15:]
    for words, told in (
        (["mine", "--like", "march"], "mine.cl: is there already"),
        (["other", "--like", "marsh"], "--like marsh: expected one of analytic, biased_march"),
        (["ratio", "--like", "march"], "expected a new name of letters"),
        (["a-b", "--like", "march"], "expected a new name of letters"),
    ):
        assert main(["new-tracker", *words]) == 2
        assert told in capsys.readouterr().err
