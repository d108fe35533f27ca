"""Pictures at equal time with maps of their errors, from the EXR files of a run with `render`.

What the picture should be is the mean of all unbiased cases of its question, each weighted by the
inverse of its variance. The pictures' own samples are not among these.
"""

from __future__ import annotations

import base64
import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from freepath.errors import FreepathError
from freepath.measure.pictures import (
    COMPARED,
    EQUAL_TIME,
    FOLDER,
    Attributes,
    exposed,
    read_exr,
    stem,
    write_png,
)
from freepath.results.folder import PLACE
from freepath.show.report.data import Report, late

MOST = 40
"""Pictures of a question: those that reach 1 % soonest."""
WIDEST = 256
"""Pixels along a side that the page shows; larger pictures are thinned out, not averaged: the noise
is what they are to show."""
WHITE = 99.0
"""The percentile of a picture's errors that is the brightest colour, of the middle picture: the
worst would leave the best black."""
# black, purple, red, orange, pale yellow; equal steps look equal (after Matplotlib's inferno, CC0)
COLOURS = np.array([
    (0, 0, 4), (31, 12, 72), (85, 15, 109), (136, 34, 106), (186, 54, 85),
    (227, 89, 51), (249, 140, 10), (249, 201, 50), (252, 255, 164),
]) / 255.0  # fmt: skip


@dataclass
class Render:
    """A case's picture at equal time, what else is known of it, and its case's record."""

    record: dict[str, Any]
    path: Path
    mean: np.ndarray
    """[height, width, channels], and so are the next two."""
    long_mean: np.ndarray
    long_variance: np.ndarray
    unbiased: bool
    samples: int
    time_s: float


def panels(report: Report) -> tuple[list[dict[str, Any]], list[str]]:
    """What the page shows of the pictures of results: one item a question and device.

    And which files it cannot show, each with the reason.
    """
    found: dict[tuple[str, str], list[Render]] = {}
    left_out = []
    for result, records in report.places:
        if not (result / EQUAL_TIME).is_dir():
            continue
        for place, record in records.items():
            name = stem(record | dict(zip(PLACE, place, strict=True)))
            paths = [result / folder / f"{name}.exr" for folder in (EQUAL_TIME, FOLDER)]
            if record["status"] not in COMPARED or not any(path.is_file() for path in paths):
                continue
            try:
                one = _read(record, *paths)
                _same_size(one, found.setdefault((record["q"], record["device"]), []))
            except UnusableError as error:
                left_out.append(str(error))
    return [_panel(*place, renders) for place, renders in found.items() if renders], left_out


class UnusableError(FreepathError):
    """A picture that cannot be shown; the message names its file."""


def _read(record: dict[str, Any], short: Path, long: Path) -> Render:
    """The two pictures of a record."""
    told, mean, _ = _parts(short)
    _, long_mean, long_variance = _parts(long)
    try:
        return Render(
            record,
            short,
            mean,
            long_mean,
            long_variance,
            told["freepath:unbiased"] == "1" and record["status"] == "ok",
            int(told["freepath:samples"]),
            float(told["freepath:time_s"]),
        )
    except KeyError as error:
        raise UnusableError(f"{short}: the attribute {error} is missing") from None
    except ValueError as error:
        raise UnusableError(f"{short}: an attribute is not a number: {error}") from None


def _parts(path: Path) -> tuple[Attributes, np.ndarray, np.ndarray]:
    """Attributes, mean and variance of a picture; raises UnusableError."""
    if not path.is_file():
        raise UnusableError(f"{path}: there is no such file")
    try:
        told, parts = read_exr(path)
        return told, parts["mean"], parts["variance"]
    except FreepathError as error:
        raise UnusableError(f"{path}: {error}") from error
    except KeyError as error:
        raise UnusableError(f"{path}: the part {error} is missing") from None


def _same_size(one: Render, others: list[Render]) -> None:
    """Put a picture beside the others of its question; raises UnusableError if it does not fit."""
    shape = others[0].mean.shape if others else one.long_mean.shape
    for mean in (one.mean, one.long_mean):
        if mean.shape != shape:
            told = (" x ".join(map(str, found)) for found in (mean.shape, shape))
            height_width_channels = "{} (height, width, channels), expected {}".format(*told)
            raise UnusableError(f"{one.path}: its size is {height_width_channels}")
    others.append(one)


def reference_of(renders: Sequence[Render]) -> tuple[np.ndarray, float]:
    """The mean of what is unbiased, or of all where nothing is, and its variance over pixels."""
    trusted = [one for one in renders if one.unbiased] or renders
    least = float(np.finfo(np.float32).tiny)
    weights = [1.0 / max(float(np.nanmean(one.long_variance)), least) for one in trusted]
    mean = np.average([one.long_mean for one in trusted], axis=0, weights=weights)
    return mean, 1.0 / sum(weights)


def rmse_of(mean: np.ndarray, reference: np.ndarray, variance: float) -> float:
    """Root mean square error over pixels; the reference's own noise is taken out."""
    return float(np.sqrt(max(0.0, np.mean((mean - reference) ** 2) - variance)))


def _panel(question: str, device: str, renders: list[Render]) -> dict[str, Any]:
    renders = sorted(renders, key=lambda one: late(one.record))[:MOST]
    reference, variance = reference_of(renders)
    scale = abs(float(np.nanmean(reference))) or 1.0
    errors = [np.abs(one.mean - reference).mean(axis=2) / scale for one in renders]
    finite = [error[np.isfinite(error)] for error in errors]
    whites = [float(np.percentile(one, WHITE)) for one in finite if one.size]
    brightest = float(np.percentile(whites, 50, method="lower")) if whites else 0.0
    exposure = exposed(reference)[1]
    items = [
        {
            "id": one.record["id"],
            "method": one.record["method"],
            "samples": one.samples,
            "time": one.time_s,
            "rmse": _finite(rmse_of(one.mean, reference, variance) / scale),
            "picture": _png(exposed(_thin(one.mean), exposure)[0]),
            "error": _png(_coloured(_thin(error[..., None])[..., 0], brightest), linear=False),
        }
        for one, error in zip(renders, errors, strict=True)
    ]
    items.sort(key=lambda one: math.inf if one["rmse"] is None else one["rmse"])
    return {
        "q": question,
        "device": device,
        "reference": _png(exposed(_thin(reference), exposure)[0]),
        "brightest": brightest,
        "items": items,
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _thin(values: np.ndarray) -> np.ndarray:
    step = -(-max(values.shape[:2]) // WIDEST)
    return values[::step, ::step]


def _coloured(error: np.ndarray, brightest: float) -> np.ndarray:
    """Errors [height, width] as sRGB, white where they are no number."""
    share = np.clip(error / brightest, 0.0, 1.0) if brightest else np.zeros_like(error)
    steps = np.linspace(0.0, 1.0, len(COLOURS))
    found = np.stack([np.interp(share, steps, channel) for channel in COLOURS.T], axis=2)
    found[~np.isfinite(error)] = 1.0
    return found


def _png(pixels: np.ndarray, *, linear: bool = True) -> str:
    """Pixels [height, width, 3] in [0, 1] as the address of a PNG that holds itself."""
    with tempfile.TemporaryDirectory(prefix="freepath-") as folder:
        base = Path(folder) / "picture"
        write_png(base, pixels, {}, linear=linear)
        data = base.with_suffix(".png").read_bytes()
    return f"data:image/png;base64,{base64.b64encode(data).decode()}"
