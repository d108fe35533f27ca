import math

import pytest
from freepath import report
from freepath.cli import main
from freepath.errors import FreepathError
from freepath.results import COLUMNS

ROW = dict.fromkeys(COLUMNS, "") | {
    "case": "transmittance/cloud-64/global/t1/delta/auto/strict",
    "status": "ok",
    "device": "a [b] <c>",
    "platform": "p",
    "driver_version": "1",
    "estimand": "transmittance",
    "medium": "cloud-64",
    "majorant": "global",
    "tightness": "1.0",
    "tracker": "delta",
    "arithmetic": "strict",
    "lanes": "16",
    "time_per_sample_s": "1e-06",
    "reference": "0.5",
    "variance": "0.25",
    "bias_rms": "0",
}


def test_a_curve_is_the_accuracy_ladder():
    points = report.curve(ROW, 1e-2)
    assert points[0] == {"time_s": 1e-6, "error": 1.0, "samples": 1.0}
    assert points[-1]["time_s"] == pytest.approx(1e-2)
    assert points[-1]["error"] == pytest.approx(1.0 / math.sqrt(1e4))


def test_a_bias_makes_a_curve_level():
    points = report.curve(ROW | {"bias_rms": "0.05"}, 10.0)
    assert points[-1]["error"] == pytest.approx(0.1, rel=1e-3)


def test_a_picture_is_drawn(tmp_path, capsys):
    (tmp_path / "summary.csv").write_text(
        ",".join(COLUMNS) + "\n" + ",".join(ROW[column] for column in COLUMNS) + "\n"
    )
    for name, start in (("p.svg", b"<svg"), ("p.png", b"\x89PNG")):
        assert main(["report", str(tmp_path), "-o", str(tmp_path / name)]) == 0
        assert (tmp_path / name).read_bytes().startswith(start)
    assert "a [b] &lt;c&gt;" in (tmp_path / "p.svg").read_text()


@pytest.mark.parametrize(
    ("result", "output", "message"),
    [
        ("nothing", "p.svg", "expected the folder of a run"),
        (".", "p.pdf", "expected a name that ends in .svg or .png"),
    ],
)
def test_what_cannot_be_drawn_is_told(tmp_path, capsys, result, output, message):
    assert main(["report", str(tmp_path / result), "-o", str(tmp_path / output)]) == 2
    assert message in capsys.readouterr().err


def test_a_result_without_a_measured_case_has_no_picture():
    with pytest.raises(FreepathError, match="no case that was measured"):
        report.chart([ROW | {"status": "skipped"}])
