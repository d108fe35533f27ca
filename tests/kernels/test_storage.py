"""Voxels in 16 bits: what is composed, what bounds and references are of, what a user is told."""

import csv
import io
import json
import re

import numpy as np
import pytest
from rich.console import Console

from freepath.cases import plan
from freepath.checks import registry
from freepath.checks.model import LEVEL
from freepath.checks.rig import Rig
from freepath.checks.verdict import Failure
from freepath.cli import main
from freepath.compose import catalog, source
from freepath.errors import VolumeError
from freepath.measure import binding
from freepath.results.folder import COLUMNS
from freepath.scene import build_medium
from freepath.scene.media.grid import GridMedium
from freepath.show import table
from freepath.show.report.data import load

TOO_LARGE = 65520.0
"""The smallest number that is rounded to infinity; 65519 is rounded to the largest half, 65504."""
TRACKERS = ("delta", "regular")


def grid(values, interpolation="nearest"):
    return GridMedium(np.asarray(values, np.float32), np.eye(3, 4), interpolation, "a.npy")


def text_of(rig, tracker, interpolation, lanes, storage, estimand="transmittance"):
    medium = {"cloud": {"resolution": 4, "interpolation": interpolation, "albedo": 0.5}}
    axes = {"majorant": "grid", "estimand": estimand, "lanes": lanes, "storage": storage}
    case = rig.case(tracker=tracker, medium=medium, **axes)
    structure = binding.structure_of(
        case, rig.catalog, build_medium(case.medium), rig.device, count=False
    )
    return source.compose(structure).text


@pytest.mark.parametrize("estimand", ["transmittance", "radiance"])
@pytest.mark.parametrize("lanes", [1, 16])
@pytest.mark.parametrize("interpolation", ["nearest", "trilinear"])
@pytest.mark.parametrize("tracker", TRACKERS)
def test_only_voxels_are_read_otherwise(rig, tracker, interpolation, lanes, estimand):
    """The kernel of halves less what says half is that of floats, to the last letter."""
    as_float, as_half = (
        text_of(rig, tracker, interpolation, lanes, storage, estimand)
        for storage in ("float", "half")
    )
    assert "half_at" not in as_float
    assert "storage_half" not in as_float
    back = re.sub(
        r'#line 1 "media/storage_half.cl"\n.*?(?=#line 1 "media/)', "", as_half, flags=re.S
    )
    assert back.count("gather_half(") >= 1
    back = back.replace("gather_half(", "gather(").replace("(__global const half *)", "")
    assert back.replace("__global const half *", "__global const float *") == as_float


def test_what_is_no_voxel_is_gathered_as_float(rig):
    text = text_of(rig, "delta", "trilinear", 16, "half")
    assert re.search(r"gather\(scene->majorant_data", text)
    assert "__global const float *majorant_data" in text


def test_voxels_are_rounded_as_numpy_does():
    values = np.random.default_rng(2).lognormal(0.0, 4.0, (3, 4, 5)).astype(np.float32)
    medium = grid(values, "trilinear")
    stored = medium.stored("half")
    assert medium.stored("float") is medium
    assert stored.data.dtype == np.float16
    assert stored.data.tolist() == values.astype(np.float16).ravel().tolist()
    assert (stored.voxels == values.astype(np.float16)).all()
    assert stored.fingerprint != medium.fingerprint
    assert stored.bounds((1, 1, 1))[1].max() == values.astype(np.float16).max()
    # one voxel along an axis is two, however often it is stored
    thin = grid(np.ones((1, 2, 2)), "trilinear")
    assert thin.stored("half").voxels.shape == thin.voxels.shape
    assert (thin.stored("half").to_medium == thin.to_medium).all()


def test_channels_are_those_of_the_medium():
    medium = grid(np.ones((2, 2, 2)))
    medium.channels = np.array([1.0, 0.5])
    assert medium.stored("half").channels.tolist() == [1.0, 0.5]


def test_what_is_too_large_is_named():
    values = np.zeros((2, 3, 4))
    values[0, 0, 0] = 65519.0
    assert grid(values).stored("half").voxels.max() == 65504.0
    values[1, 2, 3], values[1, 2, 1] = 2e6, TOO_LARGE
    with pytest.raises(VolumeError) as error:
        grid(values).stored("half")
    told = str(error.value)
    assert told.startswith("a.npy: 2 voxels are too large for storage half, which ends at 65504")
    assert "[z, y, x] = [1, 2, 1]: extinction 65520, largest 2e+06" in told
    # what it advises works
    (unit,) = set(re.findall(r"sigma_t / (\d+)", told))
    assert np.isfinite(grid(values / int(unit)).stored("half").voxels).all()


def test_a_voxel_that_stands_for_two_is_counted_once():
    with pytest.raises(VolumeError, match=r"1 voxels are .* \(first \[z, y, x\] = \[0, 1, 0\]: "):
        grid([[[1.0], [1e5], [2.0]]], "trilinear").stored("half")


def test_a_run_is_refused_before_anything_is_measured(work, capsys, selector):
    np.save(work / "v.npy", np.full((2, 2, 2), 1e5, np.float32))
    matrix = "{medium: {volume: {file: v.npy}}, tracker: delta, storage: [float, half]}"
    (work / "c.yaml").write_text(f"name: c\nmatrix: {matrix}\n")
    assert main(["run", "c.yaml", "-d", selector, "-o", "out"]) == 2
    assert "v.npy: 8 voxels are too large for storage half" in capsys.readouterr().err
    assert not (work / "out").exists()


def expand(load_text, catalog, matrix):
    return plan.expand(load_text(f"name: x\nmatrix: {matrix}\n"), catalog)


def test_the_axis(load_text, small_catalog):
    cloud = "{cloud: {resolution: 8}}"
    cases = expand(
        load_text,
        small_catalog,
        f"{{medium: [{cloud}, {{homogeneous: {{sigma_t: 1}}}}], tracker: cells,"
        " storage: [half, float]}",
    )
    assert [(case.medium.kind, case.storage) for case in cases] == [
        ("cloud", "half"),
        ("cloud", "float"),
        ("homogeneous", "float"),
    ]
    assert cases[0].name == "transmittance/cloud-8/storage=half/cells/auto/strict"
    assert cases[0].identity() == cases[1].identity() | {"storage": "half"}
    (usual,) = expand(load_text, small_catalog, f"{{medium: {cloud}, tracker: cells}}")
    assert (usual.case_id, usual.config_sha256) == (cases[1].case_id, cases[1].config_sha256)
    assert cases[0].case_id != usual.case_id


CONFIG = """
name: rounded
rays: {orthographic: {resolution: 4, direction: [0, 0, 1]}}
matrix:
  medium: {volume: {file: v.npy, sigma_t: 10, voxel_size: 0.05}}
  majorant: [global, {grid: {resolution: 2}}]
  tracker: [regular, ratio, delta]
  arithmetic: strict
  storage: [float, half]
stop: {samples: 4000}
"""
DENSITY = 40.01
"""In half 40: along a length of 0.2 that lets 0.2 % more through."""


@pytest.fixture(scope="module")
def rows(tmp_path_factory, device):
    """Of a run over voxels that are all rounded down."""
    folder = tmp_path_factory.mktemp("rounded")
    np.save(folder / "v.npy", np.full((4, 4, 4), DENSITY / 10, np.float32))
    (folder / "c.yaml").write_text(CONFIG)
    info = device.info
    selector = f"{info.platform} / {info.name} / {info.driver_version}"
    code = main(["run", str(folder / "c.yaml"), "-d", selector, "-o", str(folder / "out")])
    with (folder / "out" / "summary.csv").open() as file:
        found = list(csv.DictReader(file))
    assert code == 0, [row["reason"] for row in found]
    return found


@pytest.mark.slow
def test_the_bias_is_that_of_rounding_and_no_mismatch(rows):
    """The reference is of the densities as they are; a tracker is held to what it reads."""
    length = 4 * 0.05
    expected = np.exp(-40.0 * length) / np.exp(-np.float32(DENSITY) * length) - 1.0
    assert {row["status"] for row in rows} == {"ok"}
    assert {float(row["reference"]) for row in rows} == {float(rows[0]["reference"])}
    biases = {
        row["storage"]: float(row["bias"]) / float(row["reference"])
        for row in rows
        if row["tracker"] == "regular"
    }
    assert abs(biases["float"]) < 1e-5
    assert biases["half"] == pytest.approx(expected, abs=1e-5)
    assert expected > 1e-3  # what is above this in float would be a mismatch
    for row in rows:
        if row["tracker"] == "regular" and row["storage"] == "half":
            assert row["time_to_0.1pct_s"] == "inf"
        if row["tracker"] != "regular":
            held = expected if row["storage"] == "half" else 0.0
            off = float(row["bias"]) - held * float(row["reference"])
            assert abs(off) < 5.0 * float(row["bias_stderr"])


def test_tables_and_reports_tell_the_storage(rows, tmp_path):
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(table.table_of(rows))
    assert f"{rows[0]['lanes']} half" in console.export_text()
    with (tmp_path / "summary.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    (tmp_path / "run.json").write_text(json.dumps({}))
    report = load([tmp_path])
    assert {"regular, float storage", "regular, half storage"} <= {r["label"] for r in report.rows}


ROUNDED = next(
    check
    for check in registry.checks(catalog.load())
    if check.name == "hard/contrast/half-rounded/delta"
)


def test_majorants_of_the_unrounded_densities_are_caught(rig, monkeypatch):
    """The planted defect of the host: others are in harness/freepath/checks/planted.yaml."""
    ROUNDED.run(rig, LEVEL)
    right = GridMedium.stored

    def wrong(self, storage):
        rounded = right(self, storage)
        rounded.bounds = self.bounds
        return rounded

    monkeypatch.setattr(GridMedium, "stored", wrong)
    with pytest.raises(Failure, match="'violations': [1-9]"):
        ROUNDED.run(rig.without_scenes(), LEVEL)


def test_a_rig_with_half_storage_holds_flights_to_the_original(rig):
    axes = {"tracker": "ratio", "estimand": "transmittance", "medium": "trilinear", "lanes": 1}
    half = rig.with_storage("half")
    flight = half.flight(**axes)
    assert flight.case.storage == "half"
    assert half.flight(**axes, storage="float").case.storage == "float"
    assert (flight.reference() == rig.flight(**axes).reference()).all()
    assert (flight.as_stored().reference() != flight.reference()).any()


@pytest.mark.parametrize(
    "name",
    [
        "identity/regular/transmittance/trilinear/global",
        "hard/loose/1e3/unbiased_march",
        "hard/thin/huge-extent/ratio",
    ],
)
def test_what_halves_break_is_the_rounding_of_densities_alone(rig, monkeypatch, name):
    """What docs/checks.md says of the checks that fail: held to what is stored, they pass."""
    check = next(one for one in registry.checks(rig.catalog) if one.name == name)
    half, flight = rig.with_storage("half"), Rig.flight
    with pytest.raises(Failure):
        check.run(half, LEVEL)
    monkeypatch.setattr(Rig, "flight", lambda *rig, **axes: flight(*rig, **axes).as_stored())
    check.run(half, LEVEL)
