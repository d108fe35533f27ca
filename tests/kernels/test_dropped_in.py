"""A tracker dropped into a folder is listed, run and checked, with no other edit."""

import json
import shutil

import pytest

from freepath.checks.cases import check_case
from freepath.checks.suite.identity import WALKS, cases_of
from freepath.checks.verdict import sidak
from freepath.cli import main
from freepath.compose import catalog

# Free probabilities for real and null, with the sign of sigma_n in the weight: unbiased for any
# majorant, and delta tracking where it bounds.
SIGNED_DELTA = """/*---
title: Delta tracking with the sign of the null collisions in the weight
estimands: [transmittance, free_path]
needs: [majorant]
bounding: false
---*/
static void at_tentative(Path *path, const Scene *scene, Rng *rng, const mask here,
                         const real sigma_t)
{
    const real null = path->majorant - sigma_t;
    const real total = sigma_t + fabs(null);
    const mask hit = here & less(uniform(rng) * total, sigma_t);
    const real sign = choose(hit | ~less(null, (real)0), (real)1, (real)-1);
    path->weight = choose(here, path->weight * sign * total / path->majorant, path->weight);
    collide(path, hit);
}
"""
# The product of ratio tracking, kept in a state of its own until the path has left, and begun with
# a parameter that takes and gives nothing.
KEPT_RATIO = """/*---
title: Ratio tracking that looks at its weight at the end
estimands: [transmittance]
needs: [majorant]
bounding: false
parameters:
  scale: {default: 2, above: 0, meaning: what the product starts with}
state: {product: real}
---*/
static void begin(Path *path, const Scene *scene, Rng *rng)
{
    walk_begin(path, scene);
    path->state.product = (real)scene->tracker.scale;
}

static void step(Path *path, const Scene *scene, Rng *rng)
{
    const mask before = path->live;
    const mask here = next_tentative(path, scene, rng);
    const real real_share = sigma_t_at_tentative(path, scene, here) / path->majorant;
    const real product = path->state.product * ((SCALAR)1 - real_share);
    path->state.product = choose(here, product, path->state.product);
    const real weight = path->state.product / scene->tracker.scale;
    path->weight = choose(before & ~path->live, weight, path->weight);
}
"""
TRACKERS = {"signed_delta": SIGNED_DELTA, "kept_ratio": KEPT_RATIO}
WRONG = {
    "signed_delta": [("* sign *", "*"), ("sign * total / path->majorant", "sign")],
    "kept_ratio": [
        ("/ scene->tracker.scale", ""),
        ("((SCALAR)1 - real_share)", "exp(-real_share)"),
    ],
}
CONFIG = """
name: dropped
rays: {chords: {count: 16}}
matrix:
  medium: {linear: {bottom: 0.5, top: 2}}
  majorant: [global, {grid: {resolution: 2}}]
  tracker: delta
stop: {samples: 2000}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dropped")
    for name, text in TRACKERS.items():
        (folder / f"{name}.cl").write_text(text)
    return folder


def test_listed(folder, capsys):
    assert main(["list", "trackers", "--trackers", str(folder), "--json"]) == 0
    listed = {record["tracker"]: record for record in json.loads(capsys.readouterr().out)}
    assert listed["signed_delta"]["estimands"] == "transmittance, free_path"
    assert listed["kept_ratio"]["title"] == "Ratio tracking that looks at its weight at the end"
    assert set(catalog.load().trackers) < set(listed)


@pytest.mark.parametrize("name", TRACKERS)
def test_run(folder, rig, tmp_path, capsys, name):
    (tmp_path / "small.yaml").write_text(CONFIG)
    device = rig.device.info.driver_version
    command = ["run", str(tmp_path / "small.yaml"), "--trackers", str(folder), "-d", device]
    command += ["-a", f"tracker={name}", "-o", str(tmp_path / "out"), "--json"]
    assert main(command) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["status"] for row in rows] == ["ok", "ok"]
    assert {row["tracker"] for row in rows} == {name}
    assert all(abs(float(row["z_score"])) < 5 for row in rows)


def some_cases(tracker):
    """Two media, and majorants that bound and that do not."""
    media = ("layered", "trilinear")
    chosen = [axes for axes in cases_of(tracker) if axes["medium"] in media]
    chosen = [axes | {"majorant": WALKS[axes["majorant"]]} for axes in chosen]
    return [axes | {"tightness": tightness} for axes in chosen for tightness in (1, 0.8)]


@pytest.mark.parametrize("name", TRACKERS)
def test_checked(folder, rig, name):
    with_dropped = rig.with_trackers(catalog.load([folder]))
    chosen = some_cases(with_dropped.catalog.trackers[name])
    for axes in chosen:
        check_case(with_dropped, axes, sidak(1e-3, len(chosen)))


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [(name, *change) for name, changes in WRONG.items() for change in changes],
)
def test_a_wrong_one_is_rejected(folder, rig, tmp_path, name, old, new):
    shutil.copytree(folder, tmp_path / "wrong")
    file = tmp_path / "wrong" / f"{name}.cl"
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))
    with_dropped = rig.with_trackers(catalog.load([file.parent]))
    tracker = with_dropped.catalog.trackers[name]
    axes = next(a for a in some_cases(tracker) if a["tightness"] == 0.8)
    with pytest.raises(AssertionError, match="mean|empty space"):
        check_case(with_dropped, axes, 1e-3)


def test_delta_is_signed_delta_where_the_majorant_bounds(folder, rig):
    """Path by path, not only on average."""
    with_dropped = rig.with_trackers(catalog.load([folder]))
    axes = {"medium": "trilinear", "majorant": "grid", "lanes": 16}
    one = with_dropped.flight(tracker="signed_delta", **axes).record(256)
    other = with_dropped.flight(tracker="delta", **axes).record(256)
    assert (one.lookups != other.lookups).mean() < 1e-5
    assert abs(one.weight - 1.0).max() < 1e-5
