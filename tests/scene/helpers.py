"""Segments, media and quadrature that several tests need."""

import numpy as np
from scipy.integrate import quad

from freepath.config.models import Volume
from freepath.scene.media.formulas import Cosine, Exponential, Homogeneous, Layered, Linear
from freepath.scene.media.gaussian import Gaussian
from freepath.scene.media.grid import GridMedium

SIZE = (1.5, 2.0, 3.0)

CLOSED_FORMS = {
    "homogeneous": Homogeneous(2.0, SIZE),
    "empty": Homogeneous(0.0, SIZE),
    "falling": Linear(3.0, 0.0, SIZE),
    "rising": Linear(0.0, 3.0, SIZE),
    "atmosphere": Exponential(5.0, 0.3, SIZE),
    "steep atmosphere": Exponential(5.0, 0.02, SIZE),
    "waves": Cosine(2.0, 1.0, 3.3, 0.4, SIZE),
    "short waves": Cosine(2.0, 0.5, 40.0, -7.0, SIZE),
    "layers": Layered((0.3, 1.0, 2.5), (0.0, 3.0, 1.0, 0.2), SIZE),
    "blob": Gaussian(7.0, 0.2, None, SIZE),
    "small blob": Gaussian(700.0, 0.03, (0.7, 1.0, 1.3), SIZE),
}


def voxels(shape, scale=1.0, seed=3):
    """Return random voxels, about half of them empty."""
    rng = np.random.default_rng(seed)
    return (scale * rng.random(shape) * (rng.random(shape) > 0.5)).astype(np.float32)


GRIDS = {
    "trilinear": GridMedium(voxels((3, 4, 5)), np.eye(3, 4), "trilinear"),
    "nearest": GridMedium(voxels((3, 4, 5)), np.eye(3, 4), "nearest"),
    "dense trilinear": GridMedium(voxels((3, 4, 5), 40.0), np.eye(3, 4), "trilinear"),
    "one voxel": GridMedium(voxels((1, 3, 1)), np.eye(3, 4), "trilinear"),
}

MEDIA = CLOSED_FORMS | GRIDS


def segments_in(extent, count=24, seed=5):
    """Return random segments (N, 7) in a box; eight are parallel to axes, one is very short."""
    rng = np.random.default_rng(seed)
    start, end = rng.random((count, 3)) * extent, rng.random((count, 3)) * extent
    for row in range(6):
        start[row], end[row] = start[row], start[row]
        axis = row % 3
        start[row, axis], end[row, axis] = (0.0, extent[axis])[:: 1 if row < 3 else -1]
    start[6], end[6] = np.zeros(3), extent
    start[7, 2] = end[7, 2]
    end[8] = start[8] + 1e-7
    length = np.linalg.norm(end - start, axis=1)
    return np.column_stack([start, (end - start) / length[:, None], length])


def cut(segments, lengths):
    """Return segments with other lengths."""
    result = np.array(segments)
    result[:, 6] = lengths
    return result


def integrate(function, borders):
    """Integrate a function of one number adaptively between each two borders."""
    borders = np.unique(borders)
    pairs = zip(borders[:-1], borders[1:], strict=True)
    return sum(quad(function, a, b, epsabs=0, epsrel=1e-12, limit=200)[0] for a, b in pairs)


def borders_of(medium, segment):
    """Return where along a segment (7,) the medium may have kinks."""
    start = medium.pieces(segment[None]).start[0]
    return np.append(start, segment[6])


def write_slices(path, slices, attributes=()):
    """Write 2D arrays as the parts of an EXR or the pages of a TIFF file, all with attributes."""
    import OpenImageIO as oiio

    kinds = {"float32": "float", "float16": "half", "float64": "double"}
    specs = []
    for number, array in enumerate(slices):
        height, width = array.shape[:2]
        channels = array.shape[2] if array.ndim == 3 else 1
        kind = kinds.get(str(array.dtype), str(array.dtype))
        spec = oiio.ImageSpec(width, height, channels, kind)
        spec.attribute("oiio:subimagename", f"slice {number}")
        for name, *value in attributes:
            spec.attribute(name, *value)
        specs.append(spec)
    output = oiio.ImageOutput.create(str(path))
    for number, array in enumerate(slices):
        if number:
            opened = output.open(str(path), specs[number], "AppendSubimage")
        elif path.suffix == ".exr":
            opened = output.open(str(path), tuple(specs))
        else:
            opened = output.open(str(path), specs[0])
        assert opened, output.geterror()
        pixels = array if array.ndim == 3 else array[..., None]
        assert output.write_image(np.ascontiguousarray(pixels)), output.geterror()
    assert output.close()


def volume_model(file, **changes):
    """Return what the config's model of a volume offers."""
    return Volume(**({"file": str(file), "interpolation": "trilinear"} | changes))
