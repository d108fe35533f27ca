"""Read one grid of an OpenVDB file, with whatever this Python has that can.

Runs by itself, under the Python of the system as well, whose OpenVDB the Python of freepath cannot
load: it imports nothing of freepath, and numpy only once it reads.

    python3 openvdb_reader.py REQUEST.json

writes the densities [z, y, x] to the request's `output`, and to its `answer` one JSON object:
{"transform": 4 x 4 for row vectors, index to world, "minimum" and "maximum": indices of the first
and the last voxel, x y z, "background"}, or {"refused": why} or {"unread": which readers there
are}. Libraries write what they like to standard output. In OpenVDB an index is the centre of its
voxel.
"""

import importlib
import json
import mmap
import resource
import sys

#: numpy's name of the element types of OpenVDB that can be densities
SCALARS = {"float": "f4", "double": "f8", "half": "f4", "int32": "i4", "int64": "i8"}


class Refused(Exception):
    """The file cannot be used; the message says why."""


def damaged(reason):
    """Return the refusal of a file that a library could not read; its reason may hold any bytes."""
    printable = "".join(c if c.isprintable() else " " for c in str(reason))
    return Refused(f"it is not an OpenVDB file, or a truncated one: {' '.join(printable.split())}")


def check_box(minimum, maximum, most):
    """Refuse a grid without active voxels, and one too large for kernels or for its file."""
    count = 1
    for low, high in zip(minimum, maximum, strict=True):
        if high < low:
            raise Refused("the grid is empty: it has no active voxels")
        count *= high - low + 1
    if count > most[0]:
        raise Refused(f"the grid has {count} voxels, expected at most {most[0]}")
    if count > most[1]:
        what = f"its box has {count} voxels, {4 * count / 2**30:.3g} GiB, hardly any in the file"
        raise Refused(f"the grid is damaged, or nearly empty: {what}; crop it")


def read_with_openimageio(request):
    """Read by OpenImageIO; None where it was built without OpenVDB or cannot read the grid."""
    try:
        oiio = importlib.import_module("OpenImageIO")
    except ImportError:
        return None
    if "openvdb" not in oiio.get_string_attribute("format_list").split(","):
        return None
    path, name, place = request["path"], request["name"], request["place"]
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if data.find(b"NonlinearFrustumMap", *request["span"]) >= 0:
            # OpenImageIO reports the identity as the transform of such a grid
            raise Refused("the grid has a frustum transform, expected a linear one")
    image = oiio.ImageInput.open(path)
    if image is None:
        if request["kind"] == "float":
            raise damaged(oiio.geterror())
        return None  # what it says of types that it does not read
    wanted = name if place is None else f"{name}[{place}].{name}"
    chosen = 0
    while image.seek_subimage(chosen, 0):
        if image.spec().getattribute("oiio:subimagename") == wanted:
            break
        chosen += 1
    else:
        return None
    spec = image.spec()
    window, size = (spec.x, spec.y, spec.z), (spec.width, spec.height, spec.depth)
    minimum = spec.getattribute("openvdb:file_bbox_min") or window
    maximum = spec.getattribute("openvdb:file_bbox_max") or tuple(
        low + count - 1 for low, count in zip(window, size, strict=True)
    )
    check_box(minimum, maximum, request["most"])
    check_box(window, [low + n - 1 for low, n in zip(window, size, strict=True)], request["most"])
    voxels = image.read_image(chosen, 0, 0, 1, oiio.UNKNOWN)
    if voxels is None or image.has_error:
        raise damaged(image.geterror())
    # the image is padded to whole leaf nodes of the tree
    x, y, z = (
        slice(low - start, high + 1 - start)
        for low, high, start in zip(minimum, maximum, window, strict=True)
    )
    transform = [list(spec.getattribute("openvdb:indextoworld"))[i : i + 4] for i in (0, 4, 8, 12)]
    return voxels[z, y, x, 0], transform, minimum, maximum, None


def read_with_openvdb(request):
    """Read by OpenVDB's own module, called pyopenvdb before 12.0; None where it cannot."""
    for name in ("openvdb", "pyopenvdb"):
        try:
            vdb = importlib.import_module(name)
            import numpy as np
        except ImportError:
            continue
        break
    else:
        return None
    place = "" if request["place"] is None else f"[{request['place']}]"
    try:
        chosen = vdb.read(request["path"], request["name"] + place)
    except TypeError:  # the module is built for some types of grids only
        return None
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        raise damaged(error) from error
    if chosen.gridClass == "level set":
        raise Refused("the grid is a level set, which holds distances: convert it to a fog volume")
    if chosen.valueTypeName not in SCALARS:
        raise Refused(f"it is a grid of {chosen.valueTypeName}, expected one of scalars")
    minimum, maximum = chosen.evalActiveVoxelBoundingBox()
    check_box(minimum, maximum, request["most"])
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
    transform = [*rows, [*origin, 1.0]]
    return voxels.transpose(2, 1, 0), transform, minimum, maximum, float(chosen.background)


def main(request):
    """Read, write the array and return the answer."""
    resource.setrlimit(resource.RLIMIT_AS, (request["memory"],) * 2)
    resource.setrlimit(resource.RLIMIT_CPU, (request["seconds"], request["seconds"] + 1))
    try:
        result = read_with_openvdb(request) or read_with_openimageio(request)
        if result is None:
            modules = ("openvdb", "pyopenvdb", "OpenImageIO")
            return {"unread": [name for name in modules if name in sys.modules]}
        import numpy as np

        voxels, transform, minimum, maximum, background = result
        np.save(request["output"], np.ascontiguousarray(voxels))
    except Refused as refused:
        return {"refused": str(refused)}
    except MemoryError:
        limit = f"{request['memory'] / 2**30:.3g} GiB, the limit for a file of this size"
        return {"refused": f"it is damaged: reading it takes more than {limit}"}
    box = {"minimum": list(minimum), "maximum": list(maximum)}
    return {"transform": transform, "background": background, **box}


if __name__ == "__main__":
    with open(sys.argv[1]) as given:
        asked = json.load(given)
    answered = main(asked)
    with open(asked["answer"], "w") as file:
        json.dump(answered, file)
