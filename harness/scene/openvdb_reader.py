"""Read one grid of an OpenVDB file, with whatever this Python has that can.

Runs by itself, under the Python of the system as well, whose OpenVDB the Python of freepath cannot
load: it imports nothing of freepath, and numpy only once it reads.

    python3 openvdb_reader.py FILE GRID OUTPUT.npy    (GRID may be empty)

writes the densities [z, y, x] and prints one JSON object: {"transform": 4 x 4 for row vectors,
index to world, "minimum": index of the first voxel, x y z}, or {"refused": why} or
{"no_reader": true}. In OpenVDB an index is the centre of its voxel.
"""

import importlib
import json
import mmap
import sys

MOST_VOXELS = 2**31 - 1
#: numpy's name of the element types of OpenVDB that can be densities
SCALARS = {"float": "f4", "double": "f8", "half": "f4", "int32": "i4", "int64": "i8"}


class Refused(Exception):
    """The file cannot be used; the message says why."""


def damaged(reason):
    """Return the refusal of a file that a library could not read; its reason may hold any bytes."""
    printable = "".join(c if c.isprintable() else " " for c in str(reason))
    return Refused(f"it is not an OpenVDB file, or a truncated one: {' '.join(printable.split())}")


def choose(names, wanted):
    """Return the index of the grid `wanted`, of the only grid, or of the one called density."""
    listed = ", ".join(names)
    if wanted:
        if wanted not in names:
            raise Refused(f"there is no grid {wanted!r} of scalars, expected one of: {listed}")
        return names.index(wanted)
    if not names:
        raise Refused("it holds no grid of scalars")
    if len(names) > 1 and "density" not in names:
        raise Refused(f"it holds several grids, choose one of: {listed}")
    return names.index("density") if "density" in names else 0


def check_box(minimum, maximum):
    """Refuse a grid without active voxels, and one too large."""
    count = 1
    for low, high in zip(minimum, maximum, strict=True):
        if high < low:
            raise Refused("the grid is empty: it has no active voxels")
        count *= high - low + 1
    if count > MOST_VOXELS:
        raise Refused(f"the grid has {count} voxels, expected at most {MOST_VOXELS}")


def read_with_openimageio(path, grid):
    """Read by OpenImageIO; None where it was built without OpenVDB."""
    try:
        oiio = importlib.import_module("OpenImageIO")
    except ImportError:
        return None
    if "openvdb" not in oiio.get_string_attribute("format_list").split(","):
        return None
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if data.find(b"NonlinearFrustumMap") >= 0:
            # OpenImageIO reports the identity as the transform of such a grid
            raise Refused("it has a grid with a frustum transform, expected linear ones")
    image = oiio.ImageInput.open(path)
    if image is None:
        raise damaged(oiio.geterror())
    names, places = [], []
    while image.seek_subimage(len(names), 0):
        places.append(image.spec().nchannels == 1)
        names.append(image.spec().getattribute("oiio:subimagename"))
    scalars = [place for place, scalar in enumerate(places) if scalar]
    chosen = scalars[choose([names[place] for place in scalars], grid)]
    image.seek_subimage(chosen, 0)
    spec = image.spec()
    window, size = (spec.x, spec.y, spec.z), (spec.width, spec.height, spec.depth)
    minimum = spec.getattribute("openvdb:file_bbox_min") or window
    maximum = spec.getattribute("openvdb:file_bbox_max") or tuple(
        low + count - 1 for low, count in zip(window, size, strict=True)
    )
    check_box(minimum, maximum)
    voxels = image.read_image(chosen, 0, 0, 1, oiio.UNKNOWN)
    if voxels is None or image.has_error:
        raise damaged(image.geterror())
    # the image is padded to whole leaf nodes of the tree
    x, y, z = (
        slice(low - start, high + 1 - start)
        for low, high, start in zip(minimum, maximum, window, strict=True)
    )
    transform = [list(spec.getattribute("openvdb:indextoworld"))[i : i + 4] for i in (0, 4, 8, 12)]
    return voxels[z, y, x, 0], transform, list(minimum)


def read_with_openvdb(path, grid):
    """Read by OpenVDB's own module, which is called pyopenvdb before 12.0; None without it."""
    for name in ("openvdb", "pyopenvdb"):
        try:
            vdb = importlib.import_module(name)
            import numpy as np
        except ImportError:
            continue
        break
    else:
        return None
    try:
        grids = [g for g in vdb.readAllGridMetadata(path) if g.valueTypeName in SCALARS]
        names = [g.name for g in grids]
        chosen = vdb.read(path, names[choose(names, grid)])
    except (OSError, RuntimeError, KeyError, TypeError) as error:
        raise damaged(error) from error
    minimum, maximum = chosen.evalActiveVoxelBoundingBox()
    check_box(minimum, maximum)
    if not chosen.transform.isLinear:
        raise Refused("the grid has a frustum transform, expected a linear one")
    shape = [high + 1 - low for low, high in zip(minimum, maximum, strict=True)]
    voxels = np.zeros(shape, dtype=SCALARS[chosen.valueTypeName])
    chosen.copyToArray(voxels, ijk=minimum)
    corners = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    origin = chosen.transform.indexToWorld((0, 0, 0))
    rows = [
        [a - b for a, b in zip(chosen.transform.indexToWorld(corner), origin, strict=True)] + [0.0]
        for corner in corners
    ]
    return voxels.transpose(2, 1, 0), [*rows, [*origin, 1.0]], list(minimum)


def main(path, grid, output):
    """Read, write the array and say on standard output where it is."""
    try:
        result = read_with_openvdb(path, grid) or read_with_openimageio(path, grid)
    except Refused as refused:
        return {"refused": str(refused)}
    if result is None:
        return {"no_reader": True}
    import numpy as np

    voxels, transform, minimum = result
    np.save(output, np.ascontiguousarray(voxels))
    return {"transform": transform, "minimum": minimum}


if __name__ == "__main__":
    print(json.dumps(main(*sys.argv[1:])))
