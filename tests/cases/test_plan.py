import dataclasses
import json
import re
import subprocess
import sys

import pytest

from freepath.cases import plan
from freepath.errors import ConfigError, NothingMatchedError


@pytest.fixture
def expand(load_text, small_catalog):
    def expand(matrix, more="", overrides=()):
        text = f"name: x\nmatrix: {matrix}\n{more}"
        return plan.expand(load_text(text, overrides), small_catalog)

    return expand


def names(cases):
    return [case.name for case in cases]


CLOUD = "cloud: {resolution: 128, sigma_t: 200}"


def test_the_product_of_the_axes(expand):
    cases = expand(
        f"{{medium: {{{CLOUD}}}, majorant: [global, grid: {{resolution: 16}}],"
        " tightness: [1, 2.5], tracker: delta, lanes: [1, 16], arithmetic: [strict, fast]}"
    )
    assert len(cases) == 16
    assert [case.index for case in cases] == list(range(1, 17))
    assert cases[0].name == "transmittance/cloud-128-200/global/t1/delta/l1/strict"
    assert cases[-1].name == "transmittance/cloud-128-200/grid-16/t2.5/delta/l16/fast"
    assert len(set(names(cases))) == 16
    assert all(case.skip_reason == "" for case in cases)


def test_a_case_is_complete(expand):
    more = "seed: 9\nrays: {chords: {count: 5}}\nstop: {samples: 3}\n"
    (case,) = expand(f"{{medium: {{{CLOUD}}}, tracker: {{march: {{order: 2}}}}}}", more)
    assert case.estimand == "transmittance"
    assert case.medium.resolution == 128
    assert (case.majorant, case.tightness) == (None, None)
    assert case.tracker == "march"
    assert case.params == {"step": 0.01, "placement": "midpoint", "order": 2}
    assert (case.lanes, case.arithmetic, case.seed) == ("auto", "strict", 9)
    assert case.rays.count == 5
    assert case.stop.samples == 3
    with pytest.raises(dataclasses.FrozenInstanceError):
        case.seed = 1


def test_trackers_without_a_majorant_ignore_its_axes(expand):
    cases = expand(
        f"{{medium: {{{CLOUD}}}, majorant: [global, grid: {{resolution: 16}}],"
        " tightness: [1, 2], tracker: [delta, march]}"
    )
    assert [case.tracker for case in cases].count("delta") == 4
    (march,) = [case for case in cases if case.tracker == "march"]
    assert march.name == "transmittance/cloud-128-200/march/auto/strict"


def test_equal_values_are_one_case(expand):
    cases = expand(
        f"{{medium: [{CLOUD}, cloud: {{sigma_t: 2e2, resolution: 128, seed: 1}}],"
        " tightness: [1, 1.0], tracker: [delta, delta: , delta: {}]}"
    )
    assert len(cases) == 1


@pytest.mark.parametrize(
    ("medium", "label"),
    [
        ("homogeneous: {sigma_t: 5}", "homogeneous-5"),
        ("homogeneous: {sigma_t: 5, size: 2}", "homogeneous-5-size=2"),
        ("homogeneous: {sigma_t: 5, size: [1, 1, 2.5]}", "homogeneous-5-size=1x1x2.5"),
        ("linear: {bottom: 0, top: 1e-7}", "linear-0-1e-07"),
        ("linear: {bottom: 0.1234567890123, top: 1}", "linear-0.1234567890123-1"),
        ("layered: {breakpoints: [0.2, 0.5], values: [1, 2, 1]}", "layered-0.2x0.5-1x2x1"),
        ("layered: {breakpoints: [0.2, 0.5], values: [1, 1, 1]}", "layered-0.2x0.5-1"),
        ("layered: {breakpoints: [0.5], values: [1, 1]}", "layered-0.5-1"),
        ("cloud: {resolution: 64}", "cloud-64"),
        ("cloud: {resolution: 64, seed: 2}", "cloud-64-seed=2"),
        ("cloud: {resolution: 64, interpolation: nearest}", "cloud-64-interpolation=nearest"),
        ("volume: {file: sub/my cloud.npy, sigma_t: 40}", "volume-my_cloud.npy-40"),
        ("volume: {file: a.vdb, voxel_size: [2, 2, 4]}", "volume-a.vdb-voxel_size=2x2x4"),
    ],
)
def test_names_show_what_differs_from_the_defaults(expand, medium, label):
    (case,) = expand(f"{{medium: {{{medium}}}, tracker: march}}")
    assert case.name == f"transmittance/{label}/march/auto/strict"


def test_names_of_tracker_parameters(expand):
    cases = expand(
        f"{{medium: {{{CLOUD}}},"
        " tracker: [march, march: {step: 0.05}, march: {placement: jittered, order: 3}]}"
    )
    assert [case.name.split("/")[2] for case in cases] == [
        "march",
        "march-step=0.05",
        "march-placement=jittered-order=3",
    ]


def test_cases_of_one_name_are_told_apart(expand):
    cases = expand(
        "{medium: [volume: {file: a/x.npy}, volume: {file: b/x.npy}, volume: {file: y.npy}],"
        " tracker: march}"
    )
    assert len(set(names(cases))) == 3
    assert names(cases)[0] == f"transmittance/volume-x.npy/march/auto/strict~{cases[0].case_id}"
    assert "~" not in names(cases)[2]


@pytest.mark.parametrize(
    ("estimand", "medium", "tracker", "reason"),
    [
        ("transmittance", CLOUD, "exact", "exact needs closed form, which cloud does not offer"),
        ("transmittance", "volume: {file: x}", "cells", ""),
        (
            "transmittance",
            "linear: {bottom: 0, top: 1}",
            "cells",
            "cells needs cells, which linear does not offer",
        ),
        ("transmittance", "homogeneous: {sigma_t: 1}", "cells", ""),
        ("transmittance", "homogeneous: {sigma_t: 1}", "exact", ""),
        ("transmittance", "layered: {breakpoints: 0.5, values: [1, 2]}", "cells", ""),
        ("transmittance", "layered: {breakpoints: 0.5, values: [1, 2]}", "exact", ""),
        ("mean_extinction", CLOUD, "delta", "delta does not estimate mean_extinction"),
        (
            "transmittance",
            "cloud: {resolution: 8, channels: [1, 0.5]}",
            "delta",
            "delta follows one channel, and the medium has 2",
        ),
        (
            "free_path",
            "gaussian: {sigma_t: 1, width: 1}",
            "cells",
            "cells does not estimate free_path; cells needs cells, which gaussian does not offer",
        ),
    ],
)
def test_what_cannot_work_is_skipped_with_a_reason(expand, estimand, medium, tracker, reason):
    (case,) = expand(f"{{estimand: {estimand}, medium: {{{medium}}}, tracker: {tracker}}}")
    assert case.skip_reason == reason


TWO = (
    "{medium: [cloud: {resolution: 8}, cloud: {resolution: 16}, homogeneous: {sigma_t: 1}],"
    " majorant: [global, grid: {resolution: 4}, grid: {resolution: 8}],"
    " tightness: [1, 10], tracker: [delta, march]}"
)


@pytest.mark.parametrize(
    ("entry", "removed"),
    [
        ("{medium: cloud}", 14),
        ("{medium: {cloud: }}", 14),
        ("{medium: {cloud: {resolution: 8}}}", 7),
        ("{medium: {cloud: {resolution: 8, seed: 1}}}", 7),
        ("{medium: [{cloud: {resolution: 8}}, homogeneous]}", 14),
        ("{tracker: delta, medium: cloud, tightness: 10}", 6),
        ("{tracker: delta, tightness: [1, 10]}", 18),
        ("{majorant: grid}", 12),
        ("{majorant: {grid: {resolution: [4, 4, 4]}}}", 6),
        ("{tracker: march}", 3),
        ("{tracker: {march: {order: 1}}}", 3),
        ("[{tracker: march}, {medium: cloud}]", 15),
        ("[{medium: cloud}, {medium: cloud, tightness: 10}]", 14),
        ("{lanes: auto, majorant: global, tightness: 1}", 3),
    ],
)
def test_exclude_removes_what_matches_all_of_its_axes(expand, entry, removed):
    everything = expand(TWO)
    assert len(everything) == 21
    left = expand(TWO, f"exclude: {entry}\n")
    assert len(left) == 21 - removed
    assert set(names(left)) < set(names(everything))
    assert [case.index for case in left] == list(range(1, len(left) + 1))


@pytest.mark.parametrize(
    "entry",
    [
        "{medium: volume}",
        "{medium: {cloud: {resolution: 9}}}",
        "{medium: {cloud: {resolution: 8, seed: 2}}}",
        "{tracker: march, tightness: 10}",
        "{tracker: march, majorant: global}",
        "{tightness: 5}",
        "{lanes: 4}",
    ],
)
def test_an_exclude_entry_that_matches_nothing_is_a_mistake(expand, entry):
    with pytest.raises(ConfigError) as caught:
        expand(TWO, f"exclude:\n  - {{medium: homogeneous}}\n  - {entry}\n")
    assert str(caught.value).splitlines() == [
        "x.yaml:5:5: exclude[1]: expected an entry that matches a case of the matrix, "
        "got one that does not",
        f"      - {entry}",
        "        ^",
    ]


def test_with_overrides_an_exclude_entry_may_match_nothing(expand):
    cases = expand(TWO, "exclude: {tightness: 10}\n", ["tightness=2,3"])
    assert {case.tightness for case in cases} == {2.0, 3.0, None}


def test_include_adds_the_product_of_its_axes_and_the_matrix(expand):
    more = "include:\n  - {tracker: {march: {step: 0.1}}}\n"
    cases = expand(TWO, more)
    assert len(cases) == 24
    assert all(case.params["step"] == 0.1 for case in cases[21:])
    more = "include: {tracker: delta, tightness: [20, 30], majorant: global, lanes: [1, 2, 4]}\n"
    assert len(expand(TWO, more)) == 21 + 3 * 2 * 3


def test_include_adds_nothing_twice_and_may_bring_back_what_exclude_removed(expand):
    assert len(expand(TWO, "include: {tracker: delta}\n")) == 21
    more = "exclude: {medium: cloud}\ninclude: {medium: {cloud: {resolution: 8}}, tracker: march}\n"
    assert len(expand(TWO, more)) == 7 + 1


def test_an_override_holds_for_include_too(expand):
    more = "include: {tightness: [20, 30], lanes: 4}\n"
    cases = expand(TWO, more, ["tightness=2"])
    assert {case.tightness for case in cases} == {2.0, None}
    assert {case.lanes for case in cases} == {"auto", 4}


def test_excluding_everything_leaves_nothing(expand):
    with pytest.raises(NothingMatchedError):
        expand(TWO, "exclude: {arithmetic: strict}\n")


def test_too_many_cases_are_refused_before_they_are_made(expand):
    values = ", ".join(str(i) for i in range(1, 2001))
    with pytest.raises(ConfigError, match="matrix: expected at most 100000 cases, got 144000"):
        expand(
            f"{{medium: {{{CLOUD}}}, tightness: [{values}], lanes: [auto, 1, 2, 4, 8, 16],"
            " tracker: [delta, march, exact, cells], arithmetic: [strict, fast, double]}"
        )


def test_identity_is_canonical_json(expand):
    (case,) = expand(f"{{medium: {{{CLOUD}}}, tracker: delta}}")
    assert json.loads(json.dumps(case.identity(), allow_nan=False)) == case.identity()
    assert case.identity() == {
        "estimand": "transmittance",
        "medium": {
            "cloud": {
                "resolution": 128,
                "seed": 1,
                "sigma_t": 200.0,
                "floor": 0.0,
                "channels": None,
                "albedo": [0.0],
                "emission": [0.0],
                "phase": "henyey_greenstein",
                "g": 0.0,
                "interpolation": "trilinear",
                "size": [1.0, 1.0, 1.0],
            }
        },
        "majorant": {"global": {}},
        "tightness": 1.0,
        "tracker": {"delta": {}},
        "lanes": "auto",
        "arithmetic": "strict",
        "rays": {"orthographic": {"resolution": [64, 64], "direction": [0.0, 0.0, 1.0]}},
        "seed": 1,
        "stop": {"error": 0.01, "time_noise": 0.02, "at_most": 10.0, "samples": None, "rounds": 10},
    }
    assert re.fullmatch("[0-9a-f]{12}", case.case_id)
    assert re.fullmatch("[0-9a-f]{64}", case.config_sha256)


def test_identity_does_not_depend_on_how_the_case_is_written(expand):
    (one,) = expand("{medium: {homogeneous: {sigma_t: 0.002, size: 20}}, tracker: delta}")
    (two,) = expand(
        "{tracker: {delta: }, tightness: 1e0,"
        " medium: [{homogeneous: {size: [20 m, 2000 cm, 20.0], sigma_t: 2/km}}]}",
        "description: other words\nseed: 1\nrays: {orthographic: {resolution: [64, 64]}}\n",
    )
    assert (one.case_id, one.config_sha256) == (two.case_id, two.config_sha256)
    # the place among other cases is no part of it either
    assert dataclasses.replace(one, index=7, name="z").config_sha256 == one.config_sha256


@pytest.mark.parametrize(
    ("matrix", "more"),
    [
        ("{medium: {homogeneous: {sigma_t: 2}}, tracker: delta}", ""),
        ("{medium: {homogeneous: {sigma_t: 1, size: 2}}, tracker: delta}", ""),
        ("{medium: {homogeneous: {sigma_t: 1}}, tracker: march}", ""),
        ("{medium: {homogeneous: {sigma_t: 1}}, tracker: {march: {step: 0.2}}}", ""),
        ("{medium: {homogeneous: {sigma_t: 1}}, tracker: delta, tightness: 2}", ""),
        ("{medium: {homogeneous: {sigma_t: 1}}, tracker: delta, lanes: 4}", ""),
        ("{medium: {homogeneous: {sigma_t: 1}}, tracker: delta, arithmetic: fast}", ""),
        ("{medium: {homogeneous: {sigma_t: 1}}, tracker: delta, estimand: free_path}", ""),
        (
            "{medium: {homogeneous: {sigma_t: 1}}, tracker: delta, majorant: {grid: "
            "{resolution: 2}}}",
            "",
        ),
        ("{medium: {homogeneous: {sigma_t: 1}}, tracker: delta}", "seed: 2\n"),
        ("{medium: {homogeneous: {sigma_t: 1}}, tracker: delta}", "rays: {chords: {count: 9}}\n"),
    ],
)
def test_whatever_defines_a_case_changes_its_id(expand, matrix, more):
    (base,) = expand("{medium: {homogeneous: {sigma_t: 1}}, tracker: delta}")
    (other,) = expand(matrix, more)
    assert other.case_id != base.case_id
    assert other.config_sha256 != base.config_sha256


def test_when_to_stop_changes_the_hash_but_not_the_id(expand):
    matrix = "{medium: {homogeneous: {sigma_t: 1}}, tracker: delta}"
    (short,), (long,) = expand(matrix), expand(matrix, "stop: {at_most: 60 s}\n")
    assert short.case_id == long.case_id
    assert short.config_sha256 != long.config_sha256


def test_ids_are_the_same_in_another_process(expand, tmp_path):
    (case,) = expand("{medium: {homogeneous: {sigma_t: 1}}, tracker: delta}")
    code = (
        "import sys; from freepath.compose import catalog; from freepath import config; from "
        "freepath.cases import plan;"
        "c = catalog.load([sys.argv[1]], builtin=False);"
        "print(plan.expand(config.load('x.yaml', c.parameter_models()), c)[0].case_id)"
    )
    (tmp_path / "only").mkdir()
    text = "/*---\ntitle: x\nestimands: transmittance\nneeds: majorant\n---*/\n"
    text += "static void at_tentative(Path *path) {}\n"
    (tmp_path / "only" / "delta.cl").write_text(text)
    run = [sys.executable, "-c", code, str(tmp_path / "only")]
    result = subprocess.run(run, capture_output=True, text=True, check=True, cwd=tmp_path)
    assert result.stdout.strip() == case.case_id


@pytest.mark.parametrize(
    ("include", "exclude", "count"),
    [
        (None, None, 21),
        ("", None, 21),
        ("/delta/", None, 18),
        ("cloud-8/", None, 7),
        ("^transmittance/cloud", "t10", 8),
        (None, "cloud|march", 6),
        ("march/auto/strict$", None, 3),
    ],
)
def test_select(expand, include, exclude, count):
    cases = expand(TWO)
    selected = plan.select(cases, include, exclude)
    assert len(selected) == count
    # a case keeps its number, so that `source --case N` means the same with and without filters
    assert all(case is cases[case.index - 1] for case in selected)


def test_select_nothing(expand):
    with pytest.raises(NothingMatchedError) as caught:
        plan.select(expand(TWO), "nothing like it")
    assert caught.value.exit_code == 5
    with pytest.raises(NothingMatchedError):
        plan.select(expand(TWO), None, ".")


def test_invalid_expressions_are_mistakes_of_usage(expand):
    with pytest.raises(ConfigError) as caught:
        plan.select(expand(TWO), "(", "[a")
    assert caught.value.exit_code == 2
    first, second = str(caught.value).splitlines()
    assert first.startswith("-R (: expected a regular expression: ")
    assert second.startswith("-E [a: expected a regular expression: ")


SCENES = (
    "{medium: [homogeneous: {sigma_t: 1}, homogeneous: {sigma_t: 2}, homogeneous: {sigma_t: 3},"
    " cloud: {resolution: 8, sigma_t: 1}], majorant: [global, grid: {resolution: 4}],"
    " tightness: [1, 2], tracker: [delta, march]}"
)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 7, 18])
def test_shards_hold_each_case_once(expand, count):
    """As whole scenes where there are as many as parts, else each is of one scene."""
    cases = expand(SCENES)
    parts = [plan.shard(cases, number, count) for number in range(1, count + 1)]
    assert sorted(case.index for part in parts for case in part) == [c.index for c in cases]
    assert all(part == sorted(part, key=lambda case: case.index) for part in parts)
    homes = [{i for i, part in enumerate(parts) for c in part if c.scene == s}
             for s in {case.scene for case in cases}]  # fmt: skip
    if count <= 4:
        assert all(len(home) == 1 for home in homes)
    else:
        assert all(len({case.scene for case in part}) == 1 for part in parts)
        sizes = [len(part) for part in parts]
        assert max(sizes) <= 2 * min(sizes) + 1


def test_a_shard_without_a_case(expand):
    cases = expand(SCENES)
    with pytest.raises(NothingMatchedError, match=f"part 99 of 99 is empty, of {len(cases)}"):
        plan.shard(cases, 99, 99)


@pytest.mark.parametrize("text", ["0/3", "4/3", "x", "1/", "/2", "-1/2", "1/2/3", "1.5/2", ""])
def test_what_is_no_shard(text, capsys):
    from freepath.cli import parser

    with pytest.raises(SystemExit) as caught:
        parser().parse_args(["run", "quick", f"--shard={text}"])
    assert caught.value.code == 2
    assert f"expected I/N with I from 1 to N, such as 2/8, got '{text}'" in capsys.readouterr().err
