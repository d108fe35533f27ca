"""Damaged volumes, skies, rays and configs: none may end in a traceback, a hang or another number.

    python tests/measure/mutated_files.py [-n FILES] [-s SEED] [-f FORMAT ...] [--seconds IN_ALL]

Of each format a small sound file is written and damaged in many ways: cut, bits flipped, bytes
replaced, sizes made absurd. Each damaged file is read in a process with 2 GiB of memory, by an
alarm after 10 s. It is fine where the reader refuses it with freepath's own error; where the reader
accepts it, an independent reader must find the same numbers (.npy by its header and numpy, TIFF by
libtiff in OpenImageIO, which is right for 16 bits), or the file must hold others now. Exit code 8
if anything else happened.
"""

import argparse
import csv
import functools
import importlib
import io
import os
import random
import resource
import signal
import struct
import sys
import tempfile
import traceback
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
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


def write_vdb(path):
    from freepath.scene.volumes import openvdb

    code = (
        "import sys, numpy as np, pyopenvdb as vdb\n"
        "grid = vdb.FloatGrid(); grid.name = 'density'\n"
        "grid.copyFromArray(np.arange(120.0).reshape(4, 5, 6))\n"
        "vdb.write(sys.argv[1], grids=[grid])"
    )
    import subprocess

    subprocess.run([openvdb.SYSTEM_PYTHON, "-I", "-c", code, str(path)], check=True)


def write_rays(path):
    from freepath.scene.ray_files import COLUMNS

    rows = np.random.default_rng(3).normal(size=(12, 6)).round(4).tolist()
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([COLUMNS, *rows])


def read_volume(path):
    from freepath.scene.volumes.reading import extinction, read_volume

    volume = read_volume(path)
    return extinction(volume.densities, 1.0, path)


def read_sky(path):
    from freepath.scene.lights.sky import read_sky

    return read_sky(SimpleNamespace(file=str(path), scale=1.0), 1).table


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


def csv_again(path):
    rows = list(csv.DictReader(io.StringIO(path.read_bytes().decode("utf-8-sig"))))
    return np.array([[float(value) for _, value in sorted(row.items())] for row in rows])


FORMATS = {
    "npy": (".npy", write_npy, read_volume, npy_again),
    "exr": (".exr", write_exr, read_volume, None),
    "tif": (".tif", write_tif, read_volume, tif_again),
    "zip.tif": (".tif", write_zip_tif, read_volume, None),
    "vdb": (".vdb", write_vdb, read_volume, None),
    "sky": (".exr", write_sky, read_sky, None),
    "rays": (".csv", write_rays, read_rays, None),
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
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY + (1 << 30),) * 2)  # 1 GiB are libraries
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
    from freepath.errors import FreepathError

    try:
        found = read(path)
    except FreepathError as error:
        return f"refused\n{error}"
    except BaseException:
        return f"TRACEBACK\n{traceback.format_exc()}"
    if found is None or again is None:
        return "read\n"
    try:
        expected = again(path)
    except Exception as error:
        return f"DIFFERENT\naccepted, and {type(error).__name__}: {error}"
    same = found.shape == expected.shape and np.array_equal(found, expected, equal_nan=True)
    return "read\n" if same else f"DIFFERENT\n{found.shape} for {expected.shape}"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=2000, help="files of each format")
    parser.add_argument("-s", type=int, default=1, help="seed")
    parser.add_argument("-f", nargs="*", default=list(FORMATS), choices=FORMATS)
    parser.add_argument("--keep", type=Path, help="a folder for the files that failed")
    options = parser.parse_args()
    for module in (
        "config",
        "catalog",
        "scene.volumes",
        "scene.images",
        "scene.openvdb",
        "scene.sky",
    ):
        importlib.import_module(f"freepath.{module}")  # once, and not in each process
    for module in ("OpenImageIO", "tifffile", "imagecodecs", "freepath.scene.ray_files"):
        importlib.import_module(module)
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for name in options.f:
            suffix, write, read, again = FORMATS[name]
            path = Path(folder) / f"v{suffix}"
            write(path)
            content = path.read_bytes()
            assert outcome(path, read, again)[0] == "read", outcome(path, read, again)
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
