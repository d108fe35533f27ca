import io
import math

import numpy as np
import pytest
from rich.console import Console

from freepath.results.folder import COLUMNS
from freepath.show import table


def row_of(case="transmittance/cloud-64-50/global/t1/delta/auto/strict", **given):
    estimand, medium, *_, tracker, _, arithmetic = case.split("/")
    row = dict.fromkeys(COLUMNS, "") | {
        "case": case,
        "case_id": case,
        "status": "ok",
        "device": "pthread-Intel(R) Xeon(R) Processor @ 2.50GHz",
        "platform": "Portable Computing Language",
        "driver_version": "3.0-rc2",
        "estimand": estimand,
        "medium": medium,
        "tracker": tracker.split("-")[0],
        "tracker_label": tracker,
        "majorant": "global" if "/t" in case else "none",
        "tightness": "1.0" if "/t" in case else "",
        "lanes": "16",
        "arithmetic": arithmetic,
        "rays": "4096",
        "lookups_per_sample": "31.1",
        "lane_occupancy": "0.914",
        "counted_samples": "10000",
        "time_per_sample_s": "2.41e-07",
        "time_noise": "0.01",
        "variance_noise": "0.01",
        "estimate": "0.49",
        "reference": "0.48987",
        "bias": "-2.45e-05",
        "bias_stderr": "7e-05",
        "variance": "0.02",
        "time_to_1pct_s": "0.0002",
    }
    return row | given


def text_of(rows, width=80):
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(table.table_of(rows, width=width))
    return console.export_text()


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, ""),
        (math.inf, "never"),
        (0.0, "0 ps"),
        (1.5e-12, "1.5 ps"),
        (9.99e-10, "999 ps"),
        (5.89e-9, "5.89 ns"),
        (9.996e-7, "1 us"),
        (1.234e-3, "1.23 ms"),
        (0.5, "500 ms"),
        (1.0, "1 s"),
        (86400.0, "8.64e+04 s"),
    ],
)
def test_seconds(value, text):
    assert table.seconds(value) == text


@pytest.mark.parametrize(
    ("bias", "stderr", "reference", "text"),
    [
        ("-2.45e-05", "7e-05", "0.48987", "-0.005±0.028%"),
        ("0.01", "0.005", "0.5", "+2.0±2.0%"),
        ("0.25", "0.1", "0.5", "+50±39%"),
        ("0.001", "0.0", "0.5", "+0.2%"),
        ("1e-12", "1e-12", "0.5", "+2e-10±4e-10%"),
        ("-0.1", "0.01", "-0.5", "-20.0±3.9%"),
        ("1e-05", "1e-05", "1e-09", "+1e+06±2e+06%"),
        ("", "", "", ""),
        ("0.0", "0.0", "0.0", ""),
    ],
)
def test_bias(bias, stderr, reference, text):
    assert table.bias(row_of(bias=bias, bias_stderr=stderr, reference=reference)) == text


def test_a_table_fits_a_terminal():
    rows = [
        row_of(),
        row_of("transmittance/cloud-64-50/grid-8/t1/ratio/auto/strict", majorant="grid-8"),
        row_of("transmittance/cloud-64-50/march-step=0.05/auto/strict", time_to_1pct_s="inf"),
    ]
    lines = text_of(rows).splitlines()
    assert lines[0].rstrip() == (
        "transmittance of cloud-64-50, 4096 rays, reference 0.4899, 16 lanes"
    )
    assert len(lines) == 2 + len(rows)  # nothing was folded
    assert max(map(len, lines)) <= 80
    words = [line.split() for line in lines]
    assert words[2][:6] == ["delta", "global", "x1", "31.1", "241", "ns"]
    assert words[3][:3] == ["ratio", "grid-8", "x1"]
    assert words[4][0] == "march-step=0.05"
    assert words[4][-1] == "never"
    wide = text_of(rows, 120).splitlines()
    assert "occ." in wide[1]
    assert "91%" in wide[2]


def test_a_table_has_a_column_of_ratios_where_it_is_given():
    rows = times("0.001", "0.003")
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(table.table_of(rows, lambda row: row["case_id"] + " times", 80))
    lines = [line.rstrip() for line in console.export_text().splitlines()]
    assert lines[1].endswith("x baseline")
    assert [line[-7:] for line in lines[2:]] == ["0 times", "1 times"]


def test_the_bias_that_decides_stands_beside_the_mean():
    """A mean of 0.6 % with an RMS of 7 %: it is the RMS that keeps a case from 1 %."""
    odd = {"bias": "0.003", "bias_stderr": "0.0", "reference": "0.5", "bias_rms": "0.035"}
    assert table.bias(row_of(**odd)) == "+0.6% (7%)"
    assert "+0.6% (7%)" in text_of([row_of(**odd, time_to_1pct_s="inf")])


def test_lookups_counted_over_few_samples_are_marked():
    for counted, shown in (("64", "~31.1"), ("10000", " 31.1")):
        assert shown in text_of([row_of(counted_samples=counted)])


def test_rows_are_sorted_by_the_answer():
    """The fastest first; then what is not known, what never gets there, and what failed."""
    rows = times("0.003", "0.001", "inf", "", "0.0001", "0.00001")
    rows[4] |= {"variance_noise": "1.43"}
    rows[5] |= {"status": "mismatch"}
    shown = [line for line in text_of(rows).splitlines()[2:]]
    told = ["1 ms *", "3 ms", "?100 us", "never", "", "mismatch"]
    assert [text in line for text, line in zip(told, shown, strict=True)] == [True] * 6
    assert best(rows) == ["1"]


def test_a_table_that_is_too_wide_loses_no_number():
    case = f"transmittance/cloud-64-50/{'long' * 20}/t1/delta/auto/strict"
    text = text_of([row_of(case, majorant="long" * 20)])
    assert "241 ns" in text
    assert "200 us" in text
    assert max(map(len, text.splitlines())) <= 80


def times(*values, noise="0.01"):
    return [
        row_of(case_id=str(i), time_to_1pct_s=value, variance_noise=noise)
        for i, value in enumerate(values)
    ]


def best(rows):
    return [row["case_id"] for row in table.best_of(rows)]


def test_the_soonest_is_marked():
    assert best(times("0.003", "0.001", "0.002")) == ["1"]


def test_what_is_not_significantly_later_is_marked_too():
    assert best(times("0.00101", "0.001", "0.00105")) == ["0", "1"]
    assert best(times("0.00101", "0.001", "0.00105", noise="0.1")) == ["0", "1", "2"]
    # an interval that holds 0 says nothing: no star on 37 ms, and none on 605 s
    assert best(times("0.037", "605", noise="1.43")) == []
    # without a noise nothing is known, and then nothing is the best
    assert best(times("0.0015", "0.001", noise="")) == []


def test_a_time_that_is_known_roughly_is_marked():
    def shown(noise, **columns):
        (row,) = times("0.0002", noise=noise)
        return text_of([row | columns]).splitlines()[-1]

    assert "~" not in shown("0.19")
    assert " ~200 us" in shown("0.21")
    for noise in ("0.51", ""):
        assert " ?200 us" in shown(noise)
    assert " ~200 us" in shown("0.01", time_noise="0.3")
    # the time of a sample is the least: no variance is in it
    assert "~" not in shown("0.9", time_per_sample_s="0.0002")
    assert "~" not in shown("0.9", time_to_1pct_s="inf")
    assert "~" not in shown("0.9", time_to_1pct_s="")


def test_what_never_gets_there_is_never_the_best():
    assert best(times("inf", "")) == []
    assert best(times("inf", "3.0", "")) == ["1"]


def test_what_went_wrong_is_never_the_best():
    rows = times("0.001", "0.002")
    rows[0]["status"] = "mismatch"
    assert best(rows) == ["1"]


def test_the_best_has_a_star():
    rows = times("0.003", "0.001")
    lines = text_of(rows).splitlines()[2:]
    assert ["1 ms *" in line for line in lines] == [True, False]  # and the best comes first


def failed(status):
    empty = dict.fromkeys(
        ("lookups_per_sample", "lane_occupancy", "time_per_sample_s", "time_noise", "estimate")
        + ("variance_noise", "reference", "bias", "bias_stderr", "variance", "time_to_1pct_s"),
        "",
    )
    return row_of(status=status, reason="why", **empty)


@pytest.mark.parametrize("status", table.FAILED)
def test_a_group_of_failures_only(status):
    rows = [failed(status), failed(status)]
    (group,) = table.groups(rows)
    text = text_of(group)
    assert text.count(status) == 2
    assert "reference ?" in text
    assert table.failures(rows) == rows


def test_skipped_rows_are_counted_by_reason():
    rows = [failed("skipped"), failed("skipped"), failed("skipped") | {"reason": "other"}, row_of()]
    assert table.skipped(rows) == {"why": 2, "other": 1}
    assert table.groups(rows) == [[rows[3]]]
    assert table.failures(rows) == []


def test_an_estimate_of_nothing():
    zeros = {"estimate": "0.0", "reference": "0.0", "bias": "0.0", "bias_stderr": "0.0"}
    assert "never" in text_of([row_of(**zeros, variance="0.0", time_to_1pct_s="inf")])


def test_names_are_no_markup():
    case = "transmittance/volume-[red]x/global/t1/[bold]delta/auto/strict"
    text = text_of([row_of(case), row_of(case, status="[blink]")], width=120)
    assert "[bold]delta global x1" in text
    assert "volume-[red]x" in text
    assert "[blink]" in text


def test_groups_keep_devices_and_questions_apart():
    rows = [
        row_of(),
        row_of(driver_version="2"),
        row_of("free_path/cloud-64-50/global/t1/delta/auto/strict"),
        row_of("transmittance/cloud-64-51/global/t1/delta/auto/strict"),
        row_of(),
    ]
    assert [len(group) for group in table.groups(rows)] == [2, 1, 1, 1]
    assert [len(members) for members in table.by_device(rows).values()] == [4, 1]


def test_arithmetic_stands_beside_lanes_where_it_is_not_strict():
    assert "16 fast" in text_of([row_of(arithmetic="fast")])


def test_how_well_a_time_is_known():
    assert table.uncertainty(2.0, 1.0, 0.03, 0.04) == pytest.approx(0.05)
    assert table.uncertainty(1.0, 1.0, 0.03, 0.04) == pytest.approx(0.03)
    assert table.uncertainty(2.0, 1.0, 0.03, None) > 1.0


def test_the_soonest_and_what_is_not_significantly_later():
    assert table.soonest([]) == []
    assert table.soonest([(1.2, 0.01), (1.0, 0.01), (1.01, 0.01)]) == [1, 2]
    # an interval that is wide enough reaches down to the least, and one of the least up
    assert table.soonest([(1.2, 0.2), (1.0, 0.0)]) == [1, 0]
    assert table.soonest([(1.2, 0.0), (1.0, 0.2), (1.21, 0.0)]) == [1, 0]


def test_the_chance_that_the_truly_soonest_is_named():
    """Two that take the same are told apart as rarely as their intervals say."""
    random = np.random.default_rng(3)
    truth, relative = np.array([1.0, 1.0, 1.5]), 0.1
    found = truth * (1.0 + random.normal(size=(2000, 3)) * relative / 1.96)
    named = [table.soonest([(time, relative) for time in times]) for times in found.tolist()]
    missed = sum(not {0, 1} <= set(places) for places in named)
    assert 60 < missed < 140  # 5 % of intervals of a difference of two
    assert sum(2 in places for places in named) == 0
