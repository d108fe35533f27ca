"""Damaged volumes, skies, rays and configs: none may end in a traceback, a hang or another number.

    python tests/measure/mutated_files.py [-n FILES] [-s SEED] [-f FORMAT ...] [--keep FOLDER]

Of each format a small sound file is written and damaged in many ways: cut, bits flipped, bytes
replaced, sizes made absurd. Each damaged file is read in a process with 2 GiB of address space, by
an alarm after 10 s. It is fine where the reader refuses it with freepath's own error. Where the
reader accepts it, another reader must find the same numbers:

- .npy, .vol, .pbrt, raw and .csv by what the format's page says, written down here again,
- NanoVDB by a lookup of voxels one by one, from the root down,
- TIFF by libtiff in OpenImageIO, which is right for 16 bits,
- EXR by the OpenEXR package of PyPI, where that is installed,
- OpenVDB by Debian's OpenImageIO (the reader is pyopenvdb; the library below is one).

Where there is none, or it cannot read the file, it is said how many files were read and not held
against another reader. Exit code 8 if anything else happened.
"""

import argparse
import csv
import functools
import importlib
import io
import os
import random
import re
import resource
import signal
import struct
import subprocess
import sys
import tempfile
import traceback
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from freepath.errors import FreepathError  # noqa: E402
from freepath.scene.lights import sky  # noqa: E402
from freepath.scene.volumes import openvdb, reading  # noqa: E402
from scene import nanovdb_files  # noqa: E402

try:
    import OpenEXR
except ImportError:
    OpenEXR = None

RAW = "5x6x4 uint16 big"
NOT_KNOWN = "read, by nothing else"
MEMORY, SECONDS = 2 << 30, 10
ABSURD = [
    0,
    1,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0xFFFF,
    2**31 - 1,
    2**31,
    2**32 - 1,
    2**62,
    2**63,
    2**64 - 1,
]
VOXELS = np.random.default_rng(1).integers(1, 4000, (4, 6, 5)).astype(np.uint16)
CONFIG = """\
name: x
rays: {orthographic: {resolution: [4, 4], direction: [0, 0, 1]}}
matrix:
  medium: [homogeneous: {sigma_t: 1.5 /km, size: &s [1, 2, 3]}, volume: {file: a.vdb, grid: ''}]
  majorant: [global, grid: {resolution: 8}]
  tightness: [1, 2.5]
  tracker: [delta, ratio, {march: {step: 20 m}}]
stop: {error: 1%, at_most: 2 s}
"""


def write_npy(path):
    np.save(path, VOXELS)


def write_exr(path):
    from scene.helpers import write_slices

    write_slices(path, VOXELS.astype(np.float32))


def write_tif(path):
    import tifffile

    tifffile.imwrite(path, VOXELS, photometric="minisblack", metadata=None)


def write_zip_tif(path):
    import tifffile

    tifffile.imwrite(path, VOXELS, photometric="minisblack", compression="zlib", predictor=True)


def write_sky(path):
    import OpenImageIO as oiio

    pixels = np.random.default_rng(2).random((8, 16, 4)).astype(np.float32)
    spec = oiio.ImageSpec(16, 8, 4, "half")
    spec.channelnames = ("R", "G", "B", "Z")
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec)
    assert output.write_image(pixels)
    output.close()


def write_vol(path):
    nz, ny, nx = VOXELS.shape
    head = struct.pack("<3sB5i6f", b"VOL", 3, 1, nx, ny, nz, 1, 0, 0, 0, 1, 2, 3)
    path.write_bytes(head + VOXELS.astype("<f4").tobytes())


def write_pbrt(path):
    numbers = " ".join(map(str, VOXELS.ravel()))
    path.write_text(
        f'MakeNamedMedium "a" "string type" "uniformgrid" "integer nx" 5 "integer ny" [ 6 ]\n'
        f'"integer nz" 4 "point3 p0" [ 0 0 0 ] "point3 p1" [ 1 2 3 ] "float density" [ {numbers} ]'
    )


def write_raw(path):
    path.write_bytes(VOXELS.astype(">u2").tobytes())


def write_nvdb(path):
    nanovdb_files.written(path, VOXELS.T, first=(-2, 6, 0))


def write_zip_nvdb(path):
    nanovdb_files.written(path, VOXELS.T, "Fp8", codec=1)


def write_vdb(path):
    code = (
        "import sys, numpy as np, pyopenvdb as vdb\n"
        "grid = vdb.FloatGrid(); grid.name = 'density'\n"
        "grid.copyFromArray(np.arange(120.0).reshape(4, 5, 6))\n"
        "vdb.write(sys.argv[1], grids=[grid])"
    )
    subprocess.run([openvdb.SYSTEM_PYTHON, "-I", "-c", code, str(path)], check=True)


def write_rays(path):
    from freepath.scene.ray_files import COLUMNS

    rows = np.random.default_rng(3).normal(size=(12, 6)).round(4).tolist()
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([COLUMNS, *rows])


def read_volume(path, raw=None):
    volume = reading.read_volume(path, raw=raw)
    return reading.extinction(volume.densities, 1.0, path)


def read_raw(path):
    return read_volume(path, RAW)


def read_sky(path):
    sky.read_sky(SimpleNamespace(file=str(path), scale=1.0), 1)
    return sky._read(path)[0]


def read_rays(path):
    from freepath.scene.ray_files import read_rays

    return np.concatenate(read_rays(path), axis=1)


@functools.cache
def trackers():
    from freepath.compose import catalog

    return catalog.load([]).parameter_models()


def read_config(path):
    from freepath import config

    config.load(path, trackers())


def write_config(path):
    path.write_text(CONFIG)
    trackers()  # once, and not in each process


def npy_again(path):
    """The array after the header's own words, by nothing but the format's page."""
    import ast

    content = path.read_bytes()
    length = struct.unpack("<H", content[8:10])[0]
    header = ast.literal_eval(content[10 : 10 + length].decode("latin1"))
    kind, order = np.dtype(header["descr"]), "F" if header["fortran_order"] else "C"
    count = int(np.prod(header["shape"]))
    flat = np.frombuffer(content, kind, count, 10 + length)
    return flat.reshape(header["shape"], order=order).astype(np.float32)


def tif_again(path):
    import OpenImageIO as oiio

    image, slices = oiio.ImageInput.open(str(path)), []
    while image.seek_subimage(len(slices), 0):
        assert str(image.spec().format) in ("uint16", "half"), "another type"
        slices.append(image.read_image(len(slices), 0, 0, 1, oiio.UNKNOWN)[..., 0])
    return np.stack(slices).astype(np.float32)


def vol_again(path):
    content = path.read_bytes()
    kind, nx, ny, nz, channels = (int(n) for n in np.frombuffer(content, "<i4", 5, 4))
    assert content[:4] == b"VOL\3"
    assert channels == 1
    values = np.frombuffer(content, {1: "<f4", 3: "u1"}[kind], nx * ny * nz, 48)
    return values.reshape(nz, ny, nx).astype(np.float32)


def pbrt_again(path):
    text = "\n".join(line.split("#")[0] for line in path.read_text("utf-8").split("\n"))
    words = re.findall(r'"[^"\n]*"|[^\s"\[\]]+|[\[\]]', text)
    found, name = {}, None
    for word in words:
        inside = word.strip('" ')
        if word[0] == '"' and len(inside.split()) == 2:
            found[name := inside.split()[1]] = []
        elif name and word not in "[]":
            found[name].append(word)
    nx, ny, nz = (int(float(found[n][0])) for n in ("nx", "ny", "nz"))
    values = np.array([float(word) for word in found["density"]])
    return values.reshape(nz, ny, nx).astype(np.float32)


def raw_again(path):
    return np.frombuffer(path.read_bytes(), ">u2").reshape(VOXELS.shape).astype(np.float32)


def nvdb_again(path):
    """As many voxels as can be looked up, drawn at random."""
    lookup = nanovdb_files.Lookup(path.read_bytes())

    def same(found):
        if list(found.T.shape) != lookup.shape:
            return False
        drawn = random.Random(1).choices(range(found.size), k=1000)
        for place in zip(*np.unravel_index(drawn, found.T.shape), strict=True):
            value = lookup.value([low + int(n) for low, n in zip(lookup.low, place, strict=True)])
            if np.float32(value) != found.T[place]:
                return False
        return True

    return same


def vdb_again(path):
    """By Debian's OpenImageIO: the active box that the metadata claim, which may be damaged too.

    What goes beyond the box that was read must be empty. None where it cannot tell the box.
    """
    code = (
        "import sys, numpy as np, OpenImageIO as oiio\n"
        "image = oiio.ImageInput.open(sys.argv[1])\n"
        "spec = image.spec() if image else sys.exit(3)\n"
        "low, high = (spec.getattribute(f'openvdb:file_bbox_{n}') for n in ('min', 'max'))\n"
        "sys.exit(3) if not (low and high) else None\n"
        "voxels = image.read_image(0, 0, 0, 1, oiio.FLOAT)[..., 0]\n"
        "x, y, z = (slice(a - o, b + 1 - o) for a, b, o in"
        " zip(low, high, (spec.x, spec.y, spec.z)))\n"
        "np.save(sys.argv[2], voxels[z, y, x])"
    )
    output = path.with_suffix(".again.npy")
    command = [openvdb.SYSTEM_PYTHON, "-I", "-c", code, str(path), str(output)]
    done = subprocess.run(command, check=False, capture_output=True, timeout=60)
    assert done.returncode in (0, 3), done.stderr
    if done.returncode:
        return None
    again = np.load(output)

    def same(found):
        inside = again[tuple(map(slice, found.shape))]
        return np.array_equal(inside, found) and np.any(again) and again.sum() == inside.sum()

    return same


def exr_again(path):
    """The parts in the union of their data windows, by OpenEXR itself."""
    parts = OpenEXR.File(str(path), separate_channels=True).parts
    windows = [np.array(part.header["dataWindow"])[:, ::-1] for part in parts]
    low, high = np.min([w[0] for w in windows], axis=0), np.max([w[1] for w in windows], axis=0)
    found = np.zeros((len(parts), *(high - low + 1)), np.float32)
    for whole, part, (begin, end) in zip(found, parts, windows, strict=True):
        (channel,) = part.channels.values()
        whole[tuple(map(slice, begin - low, end - low + 1))] = channel.pixels
    return found


def sky_again(path):
    """R, G, B in the display window of the first part, by OpenEXR itself."""
    part = OpenEXR.File(str(path), separate_channels=True).parts[0]
    (low, high), shown = part.header["dataWindow"], np.array(part.header["displayWindow"])[:, ::-1]
    found = np.zeros((*(shown[1] - shown[0] + 1), 3))
    pixels = np.stack([part.channels[name].pixels for name in "RGB"], axis=-1)
    assert pixels.shape[:2] == (high[1] - low[1] + 1, high[0] - low[0] + 1)
    for y, x in np.ndindex(found.shape[:2]):
        place = y + shown[0][0] - low[1], x + shown[0][1] - low[0]
        if 0 <= place[0] < len(pixels) and 0 <= place[1] < pixels.shape[1]:
            found[y, x] = pixels[place]
    return found


def csv_again(path):
    rows = list(csv.DictReader(io.StringIO(path.read_bytes().decode("utf-8-sig"))))
    names = [f"{what}_{axis}" for what in ("origin", "direction") for axis in "xyz"]
    return np.array([[float(row[name]) for name in names] for row in rows])


FORMATS = {
    "npy": (".npy", write_npy, read_volume, npy_again),
    "exr": (".exr", write_exr, read_volume, exr_again if OpenEXR else None),
    "tif": (".tif", write_tif, read_volume, tif_again),
    "zip.tif": (".tif", write_zip_tif, read_volume, tif_again),
    "vdb": (".vdb", write_vdb, read_volume, vdb_again),
    "nvdb": (".nvdb", write_nvdb, read_volume, nvdb_again),
    "zip.nvdb": (".nvdb", write_zip_nvdb, read_volume, nvdb_again),
    "vol": (".vol", write_vol, read_volume, vol_again),
    "pbrt": (".pbrt", write_pbrt, read_volume, pbrt_again),
    "raw": (".raw", write_raw, read_raw, raw_again),
    "sky": (".exr", write_sky, read_sky, sky_again if OpenEXR else None),
    "rays": (".csv", write_rays, read_rays, csv_again),
    "config": (".yaml", write_config, read_config, None),
}


def mutate(content, chance):
    """One damage, or a few; most of them in the first 600 bytes, where headers are."""
    data = bytearray(content)
    for _ in range(chance.choice((1, 1, 1, 2, 5))):
        end = min(len(data), 600) if chance.random() < 0.7 else len(data)
        place = chance.randrange(max(end, 1))
        kind = chance.randrange(6)
        if kind == 0:
            del data[place:]
        elif kind == 1:
            data[place : place + 1] = bytes(
                [(data[place : place + 1] or b"\0")[0] ^ 1 << chance.randrange(8)]
            )
        elif kind == 2:
            data[place : place + 1] = bytes([chance.randrange(256)])
        elif kind == 3:
            size = chance.choice((1, 2, 4, 8))
            value = chance.choice(ABSURD) % 2 ** (8 * size)
            data[place : place + size] = value.to_bytes(size, chance.choice(("little", "big")))
        elif kind == 4:
            del data[place : place + chance.randrange(1, 9)]
        else:
            data[place:place] = data[place : place + chance.randrange(1, 40)]
    return bytes(data)


def outcome(path, read, again):
    """What became of a file, in a process of its own: a word, and what to tell of it."""
    readable, writable = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(readable)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.RLIM_INFINITY))
        signal.alarm(SECONDS)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        os.write(writable, attempt(path, read, again).encode()[:60_000])
        os._exit(0)
    os.close(writable)
    with os.fdopen(readable) as pipe:
        said = pipe.read()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        return "HANG" if number == signal.SIGALRM else "CRASH", f"signal {number}"
    word, _, rest = said.partition("\n")
    return word, rest


def attempt(path, read, again):
    try:
        found = read(path)
    except FreepathError as error:
        return f"refused\n{error}"
    except BaseException:
        return f"TRACEBACK\n{traceback.format_exc()}"
    signal.alarm(0)
    resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY,) * 2)
    try:
        return held(found, again(path)) if again and found is not None else NOT_KNOWN
    except UnicodeDecodeError as error:  # OpenEXR reads no attribute that is no text
        return f"{NOT_KNOWN}\n{error}"
    except Exception as error:
        return f"DIFFERENT\naccepted, and {type(error).__name__}: {error}"


def held(found, expected):
    """A word for whether numbers are those of another reader: an array, or what tells."""
    if expected is None:
        return NOT_KNOWN
    if callable(expected):
        same = expected(found)
    else:
        same = found.shape == expected.shape and np.array_equal(found, expected, equal_nan=True)
    return "read" if same else f"DIFFERENT\nof shape {found.shape}"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=2000, help="files of each format")
    parser.add_argument("-s", type=int, default=1, help="seed")
    parser.add_argument("-f", nargs="*", default=list(FORMATS), choices=FORMATS)
    parser.add_argument("--keep", type=Path, help="a folder for the files that failed")
    options = parser.parse_args()
    for module in ("OpenImageIO", "tifffile", "imagecodecs", "freepath.scene.volumes.nanovdb"):
        importlib.import_module(module)  # once, and not in each process
    if not OpenEXR:
        print("OpenEXR is not installed: whether EXR files are read right is not known")
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for name in options.f:
            suffix, write, read, again = FORMATS[name]
            path = Path(folder) / f"v{suffix}"
            write(path)
            content = path.read_bytes()
            sound = outcome(path, read, again)
            assert sound[0].startswith("read"), f"{name}: {sound}"
            chance = random.Random(f"{options.s} {name}")
            found, told = Counter(), set()
            for number in range(options.n):
                path.write_bytes(mutate(content, chance))
                word, said = outcome(path, read, again)
                found[word] += 1
                if word.isupper():
                    failed += 1
                    last = said.strip().splitlines()[-1:] or [""]
                    if last[0][:60] not in told:
                        told.add(last[0][:60])
                        print(f"{name} {number}: {word}\n{said[-1500:]}")
                    if options.keep:
                        options.keep.mkdir(exist_ok=True)
                        (options.keep / f"{name}-{number}{suffix}").write_bytes(path.read_bytes())
            print(f"{name}: {dict(found)}", flush=True)
    return 8 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
