"""The columns of summary.csv, samples.csv and confirm.csv, each once.

Headers, types and the tables of docs/notation.md are made of them:
`python -m freepath.results.columns docs/notation.md` writes these into the file.
"""

import re
import sys
from pathlib import Path
from typing import NamedTuple


class Column(NamedTuple):
    """A column of a CSV; one of texts is never read as numbers, even where it looks like one."""

    name: str
    type: str
    """str, int or float."""
    unit: str
    meaning: str


def _listed(text: str, *shared: Column) -> tuple[Column, ...]:
    """Columns from lines of name, type, unit and meaning; an indented line goes on with one."""
    lines = text.replace("\n    ", " ").strip().splitlines()
    return shared + tuple(Column(*line.split(" ", 3)) for line in lines)


SUMMARY_TABLE = _listed("""
schema_version int - of all files of a run
run_id str - which run wrote the row
case_id str - 12 hexadecimal digits for what is measured, however long
case str - the name of the case
status str - `ok`, `skipped`, `invalid` (not finite), `build_failed`, `run_failed`, `timeout`
    and `crashed` ([its process hung or ended twice](sweeps.md)), `mismatch` (claims to be unbiased
    and is beyond 6 standard errors of the reference and what the arithmetic rounds; of voxels
    stored in half, of the reference of the rounded ones)
reason str - why the status is not `ok`; with `ok` a remark, such as paths at the step cap or the
    share of lookups above the majorant
device str - its name
platform str - the name of the device's platform
driver_version str - of the device
host str - the name of the machine that measured the row
tracker str - its name; its parameters are in `params`
tracker_label str - its name with the parameters that are not their defaults
estimand str - what the case estimates
medium str - its kind with what differs from its defaults
channels int - of the medium
majorant str - its kind with its parameters, `none` of trackers without one
tightness float - majorant over the largest extinction: 1 is tight, more looser
effects str - what the kernel was composed for
light str - what shines, of paths that scatter; `none` for others
scatterings str - how often a path may scatter; `none` for other estimands
p_absorb str - [the chance that a path is absorbed at a collision](absorption.md): `auto`, `analog`
    or a number; `none` for other estimands
shadow str - the tracker of shadow rays; `none` without a point light
composition str - the axis `effects`: `auto`, or `all` that there could be
arithmetic str - `strict`, `fast` or `double`: [what that costs](arithmetic.md)
storage str - how the voxels of a grid are stored, `float` or `half`: [what that
    costs](arithmetic.md)
lanes int - paths that a work-item follows at once
work_items int - of a launch of the timed kernel: fixed on CPUs, elsewhere the fastest of [a short
    calibration](devices.md#launch-geometry)
work_group int - of these in a group, likewise or by `--work-group`
params str - all parameters of the tracker, as JSON
inputs str - [what was used of each file](files.md): of a volume its grid, type, box and background,
    of an image its channels
seed int - of all random numbers
rays int - how many
samples_per_ray int - in all measured rounds
rounds int - that were measured
stopped str - `precise`, `budget` or `samples`: why measuring ended
lookups_per_sample float - mean of the counted samples
crossings_per_sample float - of cells of the majorant; mean of the counted ones
steps_per_sample float - mean of the counted samples
lane_occupancy float - live lanes over all, over all steps of the timed kernel
time_per_sample_s float s median over rounds of the device time of a round over its samples
time_per_sample_cv float - its coefficient of variation over rounds
time_noise float - half the 95 % interval of its mean over rounds, relative
timing_source str - `device` (events), or `wall` where the driver reports no event times
time_device_s float s device time of all launches of the case
time_wall_s float s wall time of the case outside compilation
device_time_share float - the former over the latter
time_build_s float s what building the case's sources took
source_bytes int byte size of the timed kernel's source
binary_bytes int byte size of the timed kernel's binary
private_bytes int byte private memory of a work-item, as the driver says
    (`CL_KERNEL_PRIVATE_MEM_SIZE`)
lookups_per_s float 1/s lookups_per_sample over time_per_sample_s
estimate float - mean over rays
reference float - exact mean over rays, of the densities as they are given, whatever `storage`
    rounds
bias float - estimate less reference
bias_stderr float - standard error of the bias
bias_rms float - root mean square over rays of the bias with its noise taken out; 0 where noise
    explains it
z_score float - bias over bias_stderr; empty where nothing varies
variance float - of one sample, averaged over rays
variance_noise float - half its 95 % interval over rounds, relative; empty where [few high scores
    carry it](estimators.md#when-a-variance-is-not-known), with a remark in `reason`
rmse float - of one sample: rmse^2 = variance + bias_rms^2
inv_efficiency_lookups float - variance x lookups per sample: lower is better
inv_efficiency_s float s variance x seconds per sample: lower is better
figure_of_merit float 1/s that of reactor physics, 1 / (relative variance x seconds per sample):
    higher is better, biases are left out; empty where nothing varies
time_to_10pct_s float s device seconds per ray until the RMSE is 10 % of the reference; `inf` where
    the bias alone is more, empty where the variance is unknown
time_to_1pct_s float s the same for 1 %
time_to_0.1pct_s float s the same for 0.1 %
truncated int - of all samples: paths at the step cap
nonfinite int - of all samples: scores that are not finite
violations int - of the counted samples: lookups above a majorant
counted_samples int - samples that were counted, of all rays together
source_sha256 str - hash of the timed kernel's source and its build options
config_sha256 str - hash of all that defines the case, its medium and its rays
""")
OF_SUMMARY = {column.name: column for column in SUMMARY_TABLE}
SAMPLES_TABLE = _listed(
    """
round int - its number, from 0 on
samples int - of all rays together
first_sample_of_ray int - number of the round's first sample of each ray
time_device_s float s device time of the round
time_wall_s float s wall time of the round
iterations int - steps of all work-items
estimate float - mean over rays of the round's samples
variance float - of one sample; empty where a ray has but one
""",
    *map(OF_SUMMARY.get, ("schema_version", "run_id", "case_id", "device", "platform")),
)
_CASE = ("schema_version", "run_id", "case_id", "case", "device", "platform")
_SCENE = ("estimand", "medium", "tracker", "reference", "rays")
CONFIRM_TABLE = _listed(
    """
samples_per_ray int - of an independent estimate
repeats int - how many independent estimates of all rays were made
time_s float s device seconds per ray of an estimate, at the pace that the machine had when the case
    was measured
drift float - how much slower the machine was while confirming: the estimates take turns with
    ordinary rounds of the case, and their time is reported in units of these, the lower quartile of
    either over the turns, as what disturbs a round makes it longer
rmse_predicted float - sqrt(bias_rms^2 + variance x time_per_sample_s / time_s) of the case's row in
    summary.csv; empty where the variance is unknown
rmse_measured float - root mean square over rays and repeats of estimate less reference
rmse_low float - lower end of its 95 % interval (Student's t over repeats)
rmse_high float - upper end of its 95 % interval
""",
    *map(OF_SUMMARY.get, (*_CASE, *_SCENE)),
)
COLUMNS, SAMPLE_COLUMNS, CONFIRM_COLUMNS = (
    tuple(column.name for column in table)
    for table in (SUMMARY_TABLE, SAMPLES_TABLE, CONFIRM_TABLE)
)
TEXTS = frozenset(column.name for column in SUMMARY_TABLE if column.type == "str")
TYPES = {"str": "text", "int": "integer", "float": "number"}


def documented(text: str) -> str:
    """A page with its tables of columns as they are listed here, each between its two marks."""
    tables = {"summary": SUMMARY_TABLE, "samples": SAMPLES_TABLE, "confirm": CONFIRM_TABLE}
    for name, columns in tables.items():
        lines = ["| column | type, unit | meaning |", "| --- | --- | --- |"]
        for one in columns:
            unit = "" if one.unit == "-" else f", {one.unit}"
            lines.append(f"| `{one.name}` | {TYPES[one.type]}{unit} | {one.meaning} |")
        table = "\n".join(lines)
        marks = rf"(<!-- columns of {name}.csv -->\n).*?(\n<!-- end -->)"
        text, count = re.subn(marks, lambda m, t=table: m[1] + t + m[2], text, flags=re.DOTALL)
        if count != 1:
            raise ValueError(f"expected one table of {name}.csv between its marks, got {count}")
    return text


if __name__ == "__main__":
    page = Path(sys.argv[1])
    page.write_text(documented(page.read_text("utf-8")), encoding="utf-8")
