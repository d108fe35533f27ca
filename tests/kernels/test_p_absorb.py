"""The axis p_absorb: what it means for cases, for their sources and for what is told of them."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from freepath import config
from freepath.cases import plan
from freepath.cli import main
from freepath.compose import catalog
from freepath.config.path_axes import GRAIN, chance_of_absorption, weights_grow
from freepath.errors import ConfigError

POINT = {"point": {"position": [0.3, 0.4, 2.0], "intensity": 10}}
CLOUD = {"cloud": {"resolution": 8, "sigma_t": 10, "albedo": 0.8}}


def expand(folder, matrix, more="", overrides=()):
    known = catalog.load()
    (folder / "x.yaml").write_text(f"name: x\nmatrix: {matrix}\n{more}")
    loaded = config.load("x.yaml", known.parameter_models(), overrides)
    return plan.expand(loaded, known)


def test_the_axis(work):
    medium = "{homogeneous: {sigma_t: 1, albedo: 0.5}}"
    matrix = f"estimand: radiance, medium: {medium}, tracker: delta"
    (usual,) = expand(work, f"{{{matrix}}}")
    cases = expand(work, f"{{{matrix}, p_absorb: [auto, analog, 0, 30%, 0.3]}}")
    assert [case.p_absorb for case in cases] == ["auto", "analog", 0.0, 0.3]
    assert (usual.case_id, usual.config_sha256) == (cases[0].case_id, cases[0].config_sha256)
    assert cases[3].identity() == usual.identity() | {"p_absorb": 0.3}
    assert "/sunlimited/p_absorb=0.3/delta/" in cases[3].name
    assert len({case.case_id for case in cases}) == 4


def test_where_nothing_scatters_all_values_are_one_case(work):
    dark, bright = (f"{{homogeneous: {{sigma_t: 1, albedo: {one}}}}}" for one in (0, 0.5))
    matrix = f"estimand: radiance, medium: [{dark}, {bright}], tracker: delta"
    cases = expand(work, f"{{{matrix}, scatterings: [0, 2], p_absorb: [0.1, 0.2]}}")
    found = [(case.medium.albedo[0], case.scatterings, case.p_absorb) for case in cases]
    assert found == [(0, 0, "auto"), (0, 2, "auto"), (0.5, 0, "auto"), (0.5, 2, 0.1), (0.5, 2, 0.2)]


@pytest.mark.parametrize("value", ["1", "-0.1", "yes", "100%", ".nan", "[0.3, 2]"])
def test_what_is_no_chance_is_refused(work, value):
    matrix = f"{{estimand: radiance, medium: {{homogeneous: {{sigma_t: 1}}}}, p_absorb: {value}}}"
    with pytest.raises(ConfigError, match=r"p_absorb.*expected auto, analog or a fraction >= 0"):
        expand(work, matrix)


def test_without_paths_it_is_refused_where_it_stands(work):
    matrix = "{medium: {homogeneous: {sigma_t: 1}}, tracker: delta, p_absorb: 0.3}"
    with pytest.raises(ConfigError, match=r"x.yaml:2:73: matrix.p_absorb: .*got transmittance"):
        expand(work, matrix)
    assert expand(work, matrix, overrides=["estimand=free_path"])
    entry = "include:\n  - {estimand: %s}\n"
    assert len(expand(work, matrix, entry % "radiance")) == 2
    usual = "{medium: {homogeneous: {sigma_t: 1}}, tracker: delta}"
    wrong = "include:\n  - tracker: ratio\n    p_absorb: 0.3\n"
    with pytest.raises(ConfigError, match=r"x.yaml:5:15: include\[0\].p_absorb"):
        expand(work, usual, wrong)


@pytest.mark.parametrize(
    ("given", "albedo", "chance", "grow"),
    [
        (0.0, 1.0, 0.0, False),
        ("analog", 0.75, 0.25, False),
        ("analog", 1.0, 0.0, False),
        (0.5, 0.75, 0.5, True),
        (1.0 - 1e-12, 0.5, 1.0 - GRAIN, True),
        (0.3, 0.5, round(0.3 / GRAIN) * GRAIN, False),
    ],
)
def test_the_chance_is_one_that_a_kernel_can_draw(given, albedo, chance, grow):
    medium = SimpleNamespace(albedo=(albedo, albedo / 2))
    case = SimpleNamespace(p_absorb=given, medium=medium)
    assert chance_of_absorption(case) == chance
    assert np.float32(chance) == chance
    assert np.float32(1) - np.float32(chance) == 1 - chance
    assert weights_grow(case) == grow


def test_only_the_end_of_a_path_differs(rig):
    """One file takes the place of roulette's, and a number is handed over; all else is the same."""

    def text(**axes):
        given = {"estimand": "radiance", "medium": CLOUD, "tracker": "delta", "light": POINT}
        return rig.flight(majorant="grid", **given, **axes).runner.program.source.text

    unlimited, bounded, chosen = text(), text(scatterings=3), text(p_absorb=0.3)
    assert chosen == text(p_absorb="analog") == text(p_absorb=0, scatterings=3)
    assert all("p_absorb" not in one for one in (unlimited, bounded))
    part = r'#line 1 "light/{}.cl"\n.*?(?=#line 1 ")'

    def without(name, source):
        assert re.search(part.format(name), source, re.DOTALL), name
        return re.sub(part.format(name), "", source, flags=re.DOTALL)

    rest = without("p_absorb", chosen).replace(", p_absorb;", ";")
    assert rest == without("roulette", unlimited) == without("no_roulette", bounded)


@pytest.mark.parametrize("light", [POINT, "uniform"])
def test_a_sample_is_the_same_in_any_number_of_lanes(rig, light):
    axes = {"estimand": "radiance", "medium": CLOUD, "tracker": "delta", "majorant": "grid"}
    scores = [
        rig.flight(light=light, p_absorb=0.3, lanes=lanes, **axes).record(64).score
        for lanes in (1, 16)
    ]
    assert np.isclose(*scores, rtol=1e-3, atol=1e-6).mean() > 0.999


CONFIG = """
name: absorbed
rays: {chords: {count: 64}}
matrix:
  estimand: radiance
  medium: {homogeneous: {sigma_t: 1, albedo: 1}}
  tracker: delta
  p_absorb: [auto, 0, 0.2]
stop: {samples: 4000}
"""


def test_a_run_tells_the_chance(work, capsys, selector):
    (work / "c.yaml").write_text(CONFIG)
    assert main(["run", "c.yaml", "-d", selector, "-o", "out"]) == 0
    assert "delta global x1 p_absorb 0.2" in capsys.readouterr().out
    from freepath.results.folder import ResultFolder

    rows = {row["p_absorb"]: row for row in ResultFolder(work / "out", resume=True).rows()}
    found = {chance: row["status"] for chance, row in rows.items()}
    assert found == {"auto": "ok", "0.0": "ok", "0.2": "ok"}
    assert float(rows["0.0"]["variance"]) < 1e-9 < float(rows["0.2"]["variance"])
    assert "roulette" in rows["auto"]["effects"]
    assert "p_absorb" in rows["0.2"]["effects"]
