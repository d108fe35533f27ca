"""What bounds the scores of a case, and what a wrong tracker of radiance is told."""

import json
import math

import pytest

from freepath.cli import main
from freepath.measure.binding import Scene
from freepath.scene import build_medium

SINGLE = {"single": {"origin": [0.5, 0.5, -1], "direction": [0, 0, 1]}}
POINT = {"point": {"position": [0, 0, 2]}}


@pytest.mark.parametrize(
    ("axes", "largest"),
    [
        ({"estimand": "transmittance"}, 1.0),
        ({"estimand": "free_path"}, 1.0),
        ({"estimand": "path_length"}, 1.0),
        ({"estimand": "radiance"}, 3.0),
        ({"estimand": "radiance", "light": {"uniform": {"radiance": 2}}}, 4.0),
        ({"estimand": "radiance", "light": "dark"}, 2.0),
        ({"estimand": "radiance", "light": POINT}, math.inf),
        ({"estimand": "radiance", "p_absorb": 0.4}, 3.0),
        ({"estimand": "radiance", "p_absorb": 0.6}, math.inf),
        ({"estimand": "path_length", "p_absorb": 0.6}, math.inf),
    ],
)
def test_largest_score(rig, axes, largest):
    medium = {"homogeneous": {"sigma_t": 2, "emission": 2, "albedo": 0.5}}
    case = rig.case(rays=SINGLE, medium=medium, tracker="delta", **axes)
    scene = Scene.of(case, build_medium(case.medium), [])
    assert scene.largest_score(case) == pytest.approx(largest)


CONFIG = """
name: lit
rays: {chords: {count: 64}}
matrix:
  estimand: radiance
  medium: {homogeneous: {sigma_t: 2, emission: 1}}
  light: {uniform: {radiance: 3}}
  tracker: biased
stop: {samples: 4000}
"""


@pytest.mark.parametrize(("factor", "status"), [("1.0f", "ok"), ("0.9f", "mismatch")])
def test_a_wrong_radiance_is_a_mismatch(rig, tmp_path, capsys, factor, status):
    delta = rig.catalog.trackers["delta"].source
    wrong = delta.replace(
        "uniform(rng) * path->majorant", f"uniform(rng) * {factor} * path->majorant"
    )
    assert wrong != delta
    (tmp_path / "biased.cl").write_text(wrong)
    (tmp_path / "lit.yaml").write_text(CONFIG)
    command = ["run", str(tmp_path / "lit.yaml"), "--trackers", str(tmp_path), "--json"]
    command += ["-d", rig.device.info.driver_version, "-o", str(tmp_path / "out")]
    command += ["-a", "tightness=2"]
    assert main(command) == (0 if status == "ok" else 8)
    (row,) = json.loads(capsys.readouterr().out)
    assert row["status"] == status
