"""The columns of summary.csv, samples.csv and confirm.csv, each once.

Headers, types and the tables of docs/notation.md are made of them:
`python -m freepath.columns docs/notation.md` writes these into the file.
"""

import re
import sys
from pathlib import Path
from typing import NamedTuple


class Column(NamedTuple):
    """A column of a CSV; one of texts is never read as numbers, even where it looks like one."""

    name: str
    type: type[str] | type[int] | type[float]
    unit: str
    meaning: str


SUMMARY_TABLE = (
    Column("schema_version", int, "", "of all files of a run"),
    Column("run_id", str, "", "which run wrote the row"),
    Column("case_id", str, "", "12 hexadecimal digits for what is measured, however long"),
    Column("case", str, "", "the name of the case"),
    Column(
        "status",
        str,
        "",
        "`ok`, `skipped`, `invalid` (not finite), `build_failed`, `run_failed`, `crashed` ([its "
        "process ended twice](devices.md)), `mismatch` (claims to be unbiased and is beyond 6 "
        "standard errors of the reference and what the arithmetic rounds; of voxels stored in "
        "half, of the reference of the rounded ones)",
    ),
    Column(
        "reason",
        str,
        "",
        "why the status is not `ok`; with `ok` a remark, such as paths at the step cap or the "
        "share of lookups above the majorant",
    ),
    Column("device", str, "", "its name"),
    Column("platform", str, "", "the name of the device's platform"),
    Column("driver_version", str, "", "of the device"),
    Column("tracker", str, "", "its name; its parameters are in `params`"),
    Column("estimand", str, "", "what the case estimates"),
    Column("medium", str, "", "its kind with what differs from its defaults"),
    Column("channels", int, "", "of the medium"),
    Column("majorant", str, "", "its kind with its parameters, `none` of trackers without one"),
    Column("tightness", float, "", "majorant over the largest extinction: 1 is tight, more looser"),
    Column("effects", str, "", "what the kernel was composed for"),
    Column("light", str, "", "what shines, of paths that scatter; `none` for others"),
    Column("scatterings", str, "", "how often a path may scatter; `none` for other estimands"),
    Column(
        "p_absorb",
        str,
        "",
        "[the chance that a path is absorbed at a collision](absorption.md): `auto`, `analog` or "
        "a number; `none` for other estimands",
    ),
    Column("shadow", str, "", "the tracker of shadow rays; `none` without a point light"),
    Column("composition", str, "", "the axis `effects`: `auto`, or `all` that there could be"),
    Column("arithmetic", str, "", "`strict`, `fast` or `double`: [what that costs](arithmetic.md)"),
    Column(
        "storage",
        str,
        "",
        "how the voxels of a grid are stored, `float` or `half`: [what that costs](arithmetic.md)",
    ),
    Column("lanes", int, "", "paths that a work-item follows at once"),
    Column("params", str, "", "all parameters of the tracker, as JSON"),
    Column("seed", int, "", "of all random numbers"),
    Column("rays", int, "", "how many"),
    Column("samples_per_ray", int, "", "in all measured rounds"),
    Column("rounds", int, "", "that were measured"),
    Column("stopped", str, "", "`precise`, `budget` or `samples`: why measuring ended"),
    Column("lookups_per_sample", float, "", "mean of the counted samples"),
    Column("crossings_per_sample", float, "", "of cells of the majorant; mean of the counted ones"),
    Column("steps_per_sample", float, "", "mean of the counted samples"),
    Column("lane_occupancy", float, "", "live lanes over all, over all steps of the timed kernel"),
    Column(
        "time_per_sample_s",
        float,
        "s",
        "median over rounds of the device time of a round over its samples",
    ),
    Column("time_per_sample_cv", float, "", "its coefficient of variation over rounds"),
    Column("time_noise", float, "", "half the 95 % interval of its mean over rounds, relative"),
    Column(
        "timing_source",
        str,
        "",
        "`device` (events), or `wall` where the driver reports no event times",
    ),
    Column("time_device_s", float, "s", "device time of all launches of the case"),
    Column("time_wall_s", float, "s", "wall time of the case outside compilation"),
    Column("device_time_share", float, "", "the former over the latter"),
    Column("time_build_s", float, "s", "what building the case's sources took"),
    Column("source_bytes", int, "byte", "size of the timed kernel's source"),
    Column("binary_bytes", int, "byte", "size of the timed kernel's binary"),
    Column("lookups_per_s", float, "1/s", "lookups_per_sample over time_per_sample_s"),
    Column("estimate", float, "", "mean over rays"),
    Column(
        "reference",
        float,
        "",
        "exact mean over rays, of the densities as they are given, whatever `storage` rounds",
    ),
    Column("bias", float, "", "estimate less reference"),
    Column("bias_stderr", float, "", "standard error of the bias"),
    Column(
        "bias_rms",
        float,
        "",
        "root mean square over rays of the bias with its noise taken out; 0 where noise explains "
        "it",
    ),
    Column("z_score", float, "", "bias over bias_stderr; empty where nothing varies"),
    Column("variance", float, "", "of one sample, averaged over rays"),
    Column("variance_noise", float, "", "half its 95 % interval over rounds, relative"),
    Column("rmse", float, "", "of one sample: rmse^2 = variance + bias_rms^2"),
    Column("inv_efficiency_lookups", float, "", "variance x lookups per sample: lower is better"),
    Column("inv_efficiency_s", float, "s", "variance x seconds per sample: lower is better"),
    Column(
        "time_to_10pct_s",
        float,
        "s",
        "device seconds a ray until the RMSE is 10 % of the reference; `inf` where the bias alone "
        "is more, empty where the variance is unknown",
    ),
    Column("time_to_1pct_s", float, "s", "the same for 1 %"),
    Column("time_to_0.1pct_s", float, "s", "the same for 0.1 %"),
    Column("truncated", int, "", "of all samples: paths at the step cap"),
    Column("nonfinite", int, "", "of all samples: scores that are not finite"),
    Column("violations", int, "", "of the counted samples: lookups above a majorant"),
    Column("counted_samples", int, "", "samples that were counted, of all rays together"),
    Column("source_sha256", str, "", "hash of the timed kernel's source and its build options"),
    Column("config_sha256", str, "", "hash of all that defines the case, its medium and its rays"),
)
_OF_SUMMARY = {column.name: column for column in SUMMARY_TABLE}


def _shared(*names: str) -> tuple[Column, ...]:
    return tuple(_OF_SUMMARY[name] for name in names)


SAMPLES_TABLE = (
    *_shared("schema_version", "run_id", "case_id", "device", "platform"),
    Column("round", int, "", "its number, from 0 on"),
    Column("samples", int, "", "of all rays together"),
    Column("first_sample_of_ray", int, "", "number of the round's first sample of each ray"),
    Column("time_device_s", float, "s", "device time of the round"),
    Column("time_wall_s", float, "s", "wall time of the round"),
    Column("iterations", int, "", "steps of all work-items"),
    Column("estimate", float, "", "mean over rays of the round's samples"),
    Column("variance", float, "", "of one sample; empty where a ray has but one"),
)
CONFIRM_TABLE = (
    *_shared("schema_version", "run_id", "case_id", "case", "device", "platform"),
    *_shared("estimand", "medium", "tracker", "reference", "rays"),
    Column("samples_per_ray", int, "", "of an independent estimate"),
    Column("repeats", int, "", "how many independent estimates of all rays were made"),
    Column(
        "time_s",
        float,
        "s",
        "device seconds a ray of an estimate, at the pace that the machine had when the case was "
        "measured",
    ),
    Column(
        "drift",
        float,
        "",
        "how much slower the machine was while confirming: the estimates take turns with ordinary "
        "rounds of the case, and their time is reported in units of these, the lower quartile of "
        "either over the turns, as what disturbs a round makes it longer",
    ),
    Column(
        "rmse_predicted",
        float,
        "",
        "sqrt(bias_rms^2 + variance x time_per_sample_s / time_s) of the case's row in "
        "summary.csv; empty where the variance is unknown",
    ),
    Column(
        "rmse_measured",
        float,
        "",
        "root mean square over rays and repeats of estimate less reference",
    ),
    Column("rmse_low", float, "", "lower end of its 95 % interval (Student's t over repeats)"),
    Column("rmse_high", float, "", "upper end of its 95 % interval"),
)
COLUMNS, SAMPLE_COLUMNS, CONFIRM_COLUMNS = (
    tuple(column.name for column in table)
    for table in (SUMMARY_TABLE, SAMPLES_TABLE, CONFIRM_TABLE)
)
TEXTS = frozenset(column.name for column in SUMMARY_TABLE if column.type is str)
_TYPES = {str: "text", int: "integer", float: "number"}


def documented(text: str) -> str:
    """A page with its tables of columns as they are listed here, each between its two marks."""
    tables = {"summary": SUMMARY_TABLE, "samples": SAMPLES_TABLE, "confirm": CONFIRM_TABLE}
    for name, columns in tables.items():
        lines = ["| column | type, unit | meaning |", "| --- | --- | --- |"]
        for one in columns:
            of = ", ".join(filter(None, (_TYPES[one.type], one.unit)))
            lines.append(f"| `{one.name}` | {of} | {one.meaning} |")
        table = "\n".join(lines)
        marks = rf"(<!-- columns of {name}.csv -->\n).*?(\n<!-- end -->)"
        text, count = re.subn(marks, lambda m, t=table: m[1] + t + m[2], text, flags=re.DOTALL)
        if count != 1:
            raise ValueError(f"expected one table of {name}.csv between its marks, got {count}")
    return text


if __name__ == "__main__":
    page = Path(sys.argv[1])
    page.write_text(documented(page.read_text("utf-8")), encoding="utf-8")
