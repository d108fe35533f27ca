"""Pictures of cases: the mean and its variance of every pixel as EXR, and a PNG to look at."""

from __future__ import annotations

import hashlib
import os
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from freepath.errors import FreepathError, imported
from freepath.measure.stats import Moments
from freepath.results.folder import PLACE

FOLDER = "pictures"
"""Within the folder of a run."""
EQUAL_TIME = f"{FOLDER}/equal-time"
"""Those of cases that had the same device time."""
COMPARED = ("ok", "mismatch")
"""Statuses of cases that have a picture at equal time."""
CAMERAS = ("orthographic", "perspective")
"""The kinds of rays that have a picture."""
COLOURS = ("R", "G", "B")
BRIGHTEST = 99.0
"""The percentile of the positive values that the PNG shows as white; above it all is white."""
NOT_A_NUMBER = (1.0, 0.0, 1.0)
"""How the PNG shows what is no finite number."""
PNG_END = b"IEND\xaeB`\x82"
"""Type and checksum of the chunk that every PNG file ends with."""
ATTRIBUTES = {
    "case": "case",
    "case_id": "case_id",
    "run_id": "run_id",
    "status": "status",
    "estimand": "estimand",
    "medium": "medium",
    "majorant": "majorant",
    "tracker": "tracker",
    "params": "params",
    "arithmetic": "arithmetic",
    "storage": "storage",
    "light": "light",
    "seed": "seed",
    "samples": "samples_per_ray",
    "device": "device",
    "driver": "driver_version",
    "schema": "schema_version",
}
"""Attributes and the columns that they are of; as texts, since EXR's integers have but 32 bits."""
LONGEST_STEM = 150
PLACE_DIGITS = 8

Attributes = dict[str, str]


def openimageio() -> Any:
    """The library that reads and writes pictures; raises MissingPackageError where it is not."""
    return imported("OpenImageIO", "pictures of cases")


def write_pictures(folder: Path, row: Mapping[str, Any], rays: Any, moments: Moments) -> str:
    """Write the pictures of a measured case; returns what went wrong, '' if nothing did.

    `rays` is the config's model of them. Without a camera, or where a device got but a few of the
    rays, there is no picture, and nothing is wrong.
    """
    if not has_picture(rays, len(moments.mean)):
        return ""
    mean, error = picture(moments.mean, rays.resolution), moments.variance / moments.count
    attributes = attributes_of(row)
    base = folder / FOLDER / stem(row)
    try:
        base.parent.mkdir(exist_ok=True)
        write_exr(base, mean, picture(error, rays.resolution), attributes)
        write_mean(base, mean, attributes)
    except OSError as problem:
        return f"no picture: {problem.strerror or problem}"
    except FreepathError as problem:
        return f"no picture: {problem}"
    return ""


def are_there(folder: Path, row: Mapping[str, str], rays: Any) -> bool:
    """Whether a row of the folder's CSV has all of its pictures that `render` asks for."""
    if row["status"] not in COMPARED or not has_picture(rays, int(row["rays"])):
        return True
    name = f"{stem(row)}.exr"
    return all((folder / part / name).is_file() for part in (FOLDER, EQUAL_TIME))


def has_picture(rays: Any, count: int) -> bool:
    """Whether so many rays are all pixels of a camera."""
    return rays.kind in CAMERAS and count == rays.resolution[0] * rays.resolution[1]


def picture(values: np.ndarray, resolution: Sequence[int]) -> np.ndarray:
    """Values (rays,) or (rays, channels) as [height, width, channels], from the top left."""
    width, height = resolution
    return values.reshape(height, width, -1)


def stem(row: Mapping[str, Any]) -> str:
    """The name of a case's pictures without suffix, safe on any file system.

    A later row of the same case and device takes the place of the earlier one, and so do pictures.
    """
    readable = re.sub(r"[^A-Za-z0-9.+=-]+", "_", row["case"])[:LONGEST_STEM].strip(".")
    place = "\n".join(str(row[column]) for column in PLACE)
    return f"{readable}-{hashlib.sha256(place.encode()).hexdigest()[:PLACE_DIGITS]}"


def attributes_of(row: Mapping[str, Any]) -> Attributes:
    """What a picture says of its case."""
    return {f"freepath:{name}": str(row[column]) for name, column in ATTRIBUTES.items()}


def channel_names(count: int) -> tuple[str, ...]:
    """Y of one channel, R, G, B of three, numbered ones else."""
    if count == 1:
        return ("Y",)
    return COLOURS if count == len(COLOURS) else tuple(f"channel{n}" for n in range(count))


def write_exr(base: Path, mean: np.ndarray, error: np.ndarray, attributes: Attributes) -> None:
    """Write mean and variance of the mean [height, width, channels] as the parts of an EXR file.

    In float32; raises FreepathError or OSError where the file cannot be written.
    """
    oiio = openimageio()

    parts = {"mean": mean, "variance": error}
    specs = [_spec(pixels, name, attributes) for name, pixels in parts.items()]
    with _replaced(base, ".exr") as path:
        output = oiio.ImageOutput.create(str(path))
        _check(output and output.open(str(path), specs), output)
        for number, (pixels, spec) in enumerate(zip(parts.values(), specs, strict=True)):
            if number:
                _check(output.open(str(path), spec, "AppendSubimage"), output)
            with np.errstate(over="ignore"):
                narrow = np.ascontiguousarray(pixels, dtype=np.float32)
            _check(output.write_image(narrow), output)
        _check(output.close(), output)


def _spec(pixels: np.ndarray, part: str, attributes: Attributes) -> Any:
    oiio = openimageio()

    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.FLOAT)
    # the parts' channels may have the same names
    spec.channelnames = channel_names(channels)
    for name, value in {"oiio:subimagename": part, "compression": "zip", **attributes}.items():
        spec.attribute(name, value)
    return spec


def read_exr(path: Path) -> tuple[Attributes, dict[str, np.ndarray]]:
    """The attributes of a picture, and its parts [height, width, channels] in float64 by name.

    Raises FreepathError where the file cannot be read.
    """
    oiio = openimageio()

    image = oiio.ImageInput.open(str(path))
    _check(image, image)
    told: Attributes = {}
    parts: dict[str, np.ndarray] = {}
    while image.seek_subimage(len(parts), 0):
        spec = image.spec()
        told |= {one.name: str(one.value) for one in spec.extra_attribs}
        pixels = image.read_image(len(parts), 0, 0, spec.nchannels, oiio.FLOAT)
        _check(pixels is not None, image)
        parts[told["oiio:subimagename"]] = pixels.astype(np.float64)
    image.close()
    return told, parts


def write_mean(base: Path, mean: np.ndarray, attributes: Attributes) -> None:
    """Write a mean [height, width, channels] as PNG; `freepath:exposure` is what it is times."""
    shown, exposure = exposed(mean)
    write_png(base, shown, {**attributes, "freepath:exposure": f"{exposure:g}"})


def write_png(
    base: Path, pixels: np.ndarray, attributes: Attributes, *, linear: bool = True
) -> None:
    """Write RGB in [0, 1] as sRGB, `linear` or encoded already."""
    oiio = openimageio()

    result = oiio.ImageBuf(np.ascontiguousarray(pixels, dtype=np.float32))
    if linear:
        # not the configuration that $OCIO may name, which need not know these spaces
        result = oiio.ImageBufAlgo.colorconvert(
            result, "lin_srgb", "sRGB", colorconfig="ocio://default"
        )
    _check(not result.has_error, result)
    for name, value in attributes.items():
        result.specmod().attribute(name, value)
    with _replaced(base, ".png") as path:
        _check(result.write(str(path), oiio.UINT8), result)
        if not path.read_bytes().endswith(PNG_END):  # OpenImageIO 3.2 does not notice a full disk
            raise FreepathError("the PNG file could not be written to its end")


def exposed(mean: np.ndarray, exposure: float | None = None) -> tuple[np.ndarray, float]:
    """Return a mean as linear RGB in [0, 1], and what it was multiplied by.

    White is a percentile of the positive values, unless an exposure is given. Channels that are no
    colours are averaged.
    """
    colours = mean if mean.shape[2] == len(COLOURS) else mean.mean(axis=2, keepdims=True)
    finite = np.isfinite(colours)
    positive = colours[finite & (colours > 0.0)]
    if exposure is None:
        exposure = 1.0 / float(np.percentile(positive, BRIGHTEST)) if positive.size else 1.0
    shown = np.clip(np.where(finite, colours, 0.0) * exposure, 0.0, 1.0)
    shown = np.repeat(shown, len(COLOURS) // shown.shape[2], axis=2)
    shown[~finite.all(axis=2)] = NOT_A_NUMBER
    return shown, exposure


@contextmanager
def _replaced(base: Path, suffix: str) -> Iterator[Path]:
    """Write beside, and replace in one step what was there; leave nothing of what failed.

    Raises FreepathError where a folder is a symbolic link: it leads to what is not the run's.
    """
    for link in base.parents[:2]:
        if link.name in EQUAL_TIME.split("/") and link.is_symlink():
            raise FreepathError(f"{link} is a symbolic link")
    with tempfile.TemporaryDirectory(dir=base.parent, prefix=".") as folder:
        yield Path(folder) / f"picture{suffix}"
        os.replace(Path(folder) / f"picture{suffix}", base.with_name(base.name + suffix))


def _check(succeeded: Any, image: Any) -> None:
    """Raise FreepathError with what OpenImageIO says is wrong."""
    oiio = openimageio()

    if not succeeded:
        message = (image.geterror() if image else oiio.geterror()).strip()
        raise FreepathError(message.split("\n")[0] or "OpenImageIO gives no reason")
