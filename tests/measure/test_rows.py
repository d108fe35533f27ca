import math
from types import SimpleNamespace

import numpy as np
import pytest

from freepath.cases import plan
from freepath.device.opencl import COUNTERS, DeviceInfo
from freepath.measure import row as rows
from freepath.measure.rounds import Measurement
from freepath.measure.runner import Round
from freepath.measure.stats import Moments
from freepath.results.folder import COLUMNS, SAMPLE_COLUMNS

RAYS = 4
INFO = DeviceInfo("thing", "maker", "1.2", "CPU", 2, 8, True, 1e-9, "builtin", False)
NUMBERS = (
    "samples_per_ray",
    "rounds",
    "lookups_per_sample",
    "lane_occupancy",
    "time_per_sample_s",
    "time_device_s",
    "estimate",
    "reference",
    "variance",
    "time_to_1pct_s",
    "truncated",
    "violations",
)


@pytest.fixture
def case(load_text, small_catalog):
    def case(**axes):
        axes = {"medium": "{cloud: {resolution: 8}}", "tracker": "delta"} | axes
        matrix = ", ".join(f"{axis}: {value}" for axis, value in axes.items())
        loaded = load_text(f"name: x\nmatrix: {{{matrix}}}\n")
        (found,) = plan.expand(loaded, small_catalog)
        return found

    return case


@pytest.fixture
def base(case):
    return rows.base_row(case(), INFO, "run") | {"rays": RAYS}


def tracker(*, unbiased=True):
    return SimpleNamespace(unbiased=unbiased)


def round_of(per_ray=100, *, estimate=0.5, variance=0.25, seconds=1e-6, source="device", **counts):
    samples = per_ray * RAYS
    return Round(
        samples=samples,
        estimate=estimate,
        variance=variance,
        counters=dict.fromkeys(COUNTERS, 0) | {"steps": 3 * samples} | counts,
        iterations=samples // 2,
        time_device_s=seconds * samples if source == "device" else 0.0,
        time_wall_s=2 * seconds * samples,
        timing_source=source,
        moments=Moments(per_ray, np.full(RAYS, estimate), np.full(RAYS, variance * (per_ray - 1))),
    )


def measurement(*measured, counted=None):
    found = Measurement(counted=counted or round_of(lookups=2000, crossings=400))
    for one in measured or [round_of(seconds=s) for s in (1e-6, 3e-6, 2e-6)]:
        found.add(one)
    found.stopped, found.time_wall_s, found.time_device_s = "precise", 4.0, 3.0
    return found


def row_of(base, found, reference=0.5, **given):
    return rows.measured_row(base, tracker(**given), found, np.full(RAYS, reference), 1.0)


def test_a_row_has_every_column_before_anything_ran(base):
    assert tuple(base) == COLUMNS
    assert (base["device"], base["platform"], base["driver_version"]) == ("thing", "maker", "1.2")
    assert (base["tracker"], base["majorant"], base["tightness"]) == ("delta", "global", 1.0)
    assert base["lanes"] == 8  # which auto means on this device
    assert base["params"] == "{}"
    for column in NUMBERS:
        assert base[column] is None, column


def test_a_row_without_a_majorant_says_so(case):
    row = rows.base_row(case(tracker="{march: {order: 2}}", lanes="1"), INFO, "run")
    assert (row["majorant"], row["tightness"]) == ("none", None)
    assert row["lanes"] == 1
    assert row["params"] == '{"order": 2, "placement": "midpoint", "step": 0.01}'


def test_a_skipped_row_has_a_reason_and_no_numbers(case):
    row = rows.base_row(case(tracker="exact"), INFO, "run")
    assert row["status"] == "skipped"
    assert row["reason"] == "exact needs closed form, which cloud does not offer"
    assert all(row[column] is None for column in NUMBERS)


def test_effects_are_those_that_were_composed(case):
    assert rows.composed_for(case(), "homogeneous") == "absorption"
    assert rows.composed_for(case(), "grid_trilinear") == "absorption+heterogeneous"
    grid = case(majorant="{grid: {resolution: 4}}")
    assert rows.composed_for(grid, "grid_nearest") == "absorption+heterogeneous+majorant_grid"


def test_costs(base):
    row = row_of(base, measurement())
    assert tuple(row) == COLUMNS
    assert (row["status"], row["reason"]) == ("ok", "")
    assert (row["samples_per_ray"], row["rounds"], row["stopped"]) == (300, 3, "precise")
    assert row["lookups_per_sample"] == 5.0
    assert row["crossings_per_sample"] == 1.0
    assert row["steps_per_sample"] == 3.0
    assert row["counted_samples"] == 400
    assert row["lane_occupancy"] == 3 * 400 / (200 * 8)
    assert row["time_per_sample_s"] == pytest.approx(2e-6)  # the median
    assert row["time_per_sample_cv"] == pytest.approx(0.5)
    assert row["time_noise"] == pytest.approx(4.3026527 / math.sqrt(3) / 2)
    assert row["lookups_per_s"] == pytest.approx(5.0 / 2e-6)
    assert row["device_time_share"] == 0.75


def test_errors(base):
    row = row_of(base, measurement())
    assert (row["estimate"], row["reference"], row["bias"]) == (0.5, 0.5, 0.0)
    assert row["variance"] == pytest.approx(0.25, rel=0.01)
    assert row["variance_noise"] == 0.0
    assert row["rmse"] ** 2 == pytest.approx(row["variance"])
    assert row["inv_efficiency_lookups"] == pytest.approx(5 * row["variance"])
    assert row["inv_efficiency_s"] == pytest.approx(2e-6 * row["variance"])
    assert row["figure_of_merit"] == pytest.approx(0.5**2 / (2e-6 * row["variance"]))
    assert row["time_to_1pct_s"] == pytest.approx(2e-6 * row["variance"] / 0.005**2)
    assert row["time_to_10pct_s"] == pytest.approx(2e-6 * max(1, row["variance"] / 0.05**2))
    assert row["time_to_0.1pct_s"] == pytest.approx(100 * row["time_to_1pct_s"])


def test_a_last_smaller_round_is_not_timed(base):
    row = row_of(base, measurement(round_of(), round_of(), round_of(7, seconds=1.0)))
    assert row["time_per_sample_s"] == pytest.approx(1e-6)
    assert (row["samples_per_ray"], row["rounds"]) == (207, 3)


def test_a_single_round_has_no_noise(base):
    row = row_of(base, measurement(round_of()))
    for column in ("time_per_sample_cv", "time_noise", "variance_noise"):
        assert row[column] is None


def test_wall_time_where_the_driver_reports_none(base):
    row = row_of(base, measurement(round_of(source="wall")))
    assert row["timing_source"] == "wall"
    assert row["time_per_sample_s"] == pytest.approx(2e-6)


def test_a_wrong_estimate_is_a_mismatch(base):
    row = row_of(base, measurement(round_of(10**6)), reference=0.52)
    assert row["status"] == "mismatch"
    assert row["reason"].endswith("standard errors from the float64 reference")
    assert row["estimate"] == 0.5


def test_a_wrong_value_without_variance_is_a_mismatch(base):
    exact = round_of(variance=0.0)
    assert row_of(base, measurement(exact), reference=0.5004)["status"] == "ok"
    row = row_of(base, measurement(exact), reference=0.501)
    assert (row["status"], row["z_score"]) == ("mismatch", None)
    assert row["reason"] == "-0.001 from the float64 reference 0.501"


def test_a_biased_tracker_may_be_wrong(base):
    row = row_of(base, measurement(round_of(10**6)), reference=0.52, unbiased=False)
    assert (row["status"], row["time_to_1pct_s"]) == ("ok", math.inf)


def test_scores_that_are_no_numbers_make_a_row_invalid(base):
    bad = round_of(estimate=math.nan, variance=math.nan, nonfinite=3)
    row = row_of(base, measurement(round_of(), bad))
    assert (row["status"], row["nonfinite"]) == ("invalid", 3)
    assert row["reason"] == "3 scores are infinite or not a number"
    for column in ("estimate", "bias", "variance", "rmse", "time_to_1pct_s"):
        assert row[column] is None
    assert row["time_per_sample_s"] is not None


def test_a_variance_that_overflows_makes_a_row_invalid(base):
    assert row_of(base, measurement(round_of(variance=math.inf)))["status"] == "invalid"


def test_paths_that_were_cut_off_are_told_and_do_not_excuse(base):
    row = row_of(base, measurement(round_of(10**6, truncated=9)), reference=0.5)
    assert (row["status"], row["truncated"]) == ("ok", 9)
    assert row["reason"] == "9 paths were cut off at the step cap"
    row = row_of(base, measurement(round_of(10**6, truncated=9)), reference=0.52)
    assert row["status"] == "mismatch"
    assert row["reason"].endswith("reference; 9 paths were cut off at the step cap")


def test_a_violated_majorant_is_told_and_excused(base):
    counted = round_of(lookups=2000, violations=500)
    row = row_of(base, measurement(round_of(10**6), counted=counted), reference=0.52)
    assert (row["status"], row["violations"]) == ("ok", 500)
    assert row["reason"] == "25 % of the lookups were above the majorant"


def test_scores_that_are_all_0_have_no_known_time(base):
    row = row_of(base, measurement(round_of(estimate=0.0, variance=0.0)), reference=1e-20)
    assert (row["status"], row["time_to_1pct_s"]) == ("ok", None)
    assert row["reason"] == "all scores are 0: too few samples to tell their variance"


def test_a_row_a_round(base):
    found = measurement(round_of(), round_of(), round_of(1, variance=0.0))
    found.rounds[2] = Round(**vars(found.rounds[2]) | {"variance": None})
    first, second, third = (
        {column: row[column] for column in SAMPLE_COLUMNS}
        for row in rows.round_rows(row_of(base, found), found)
    )
    assert [one["round"] for one in (first, second, third)] == [0, 1, 2]
    assert [one["first_sample_of_ray"] for one in (first, second, third)] == [0, 100, 200]
    assert (first["case_id"], first["device"], first["run_id"]) == (base["case_id"], "thing", "run")
    assert (second["samples"], second["estimate"], second["variance"]) == (400, 0.5, 0.25)
    assert (third["samples"], third["variance"]) == (4, None)
