"""`freepath try`: a right tracker is accepted, wrong ones are rejected by name."""

import json

import pytest

from freepath.checks import registry
from freepath.checks.model import LEVEL
from freepath.checks.verdict import Failure
from freepath.cli import main
from freepath.compose import catalog
from freepath.extras import candidate
from support.slips import NAME, RIGHT, SLIPS

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
    known, tracker = candidate.read(file)
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
    assert "1 % after" in text
    page = (file.parent / "out" / "report.html").read_text("utf-8")
    assert NAME in page
    assert "2 checks passed" in page
    assert main(["run", "out/try.yaml", "--trackers", file.name, "-N"]) == 0


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
    assert "none.npy: expected a volume" in text


def test_relatives_are_those_alike(file):
    known, tracker = candidate.read(file)
    near = [other.name for other in candidate.relatives(known, tracker)]
    assert "ratio" in near
    assert "march" not in near


def test_what_is_not_known_does_not_pay():
    """The own case a thousand times as fast, of an interval that holds 0, or a relative's."""
    base = {"tn": 0.01, "vn": 0.01, "t": 1e-9, "unknown": [], "method": "m"}
    known, lucky = base | {"t1": 1e-3}, base | {"t1": 1e-6, "vn": 1.5, "unknown": ["t1"]}
    told = str(candidate.Standing("q", candidate._soonest([lucky]), known))
    assert told == "not known: the variance of its scores is not settled"
    assert candidate._soonest([lucky, known]) is known
    told = str(candidate.Standing("q", known, candidate._soonest([lucky])))
    assert told.endswith("none of its relatives is known to reach it")
