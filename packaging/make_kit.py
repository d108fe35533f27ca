"""Makes the kit: a folder that sets freepath up on a machine without a package index.

    python packaging/make_kit.py kit [--python 3.12] [--own-only]

Wheels of freepath, from this tree, and of what it needs to run, check and list devices; run.sh,
which installs and tries them; README.md. Packages that only pictures and charts need are left out.
"""

import argparse
import configparser
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent
SOURCES = (
    "harness",
    "kernels",
    "configs",
    "setup.py",
    "setup.cfg",
    "pyproject.toml",
    "README.md",
    "LICENSE",
)
LEFT_OUT = ("OpenImageIO", "imagecodecs")
"""Requirements of pictures and images alone: each would be as large as half of the kit."""
PLATFORMS = ("_2_28", "_2_27", "_2_26", "_2_24", "_2_17", "2014", "_2_12", "2010", "_2_5", "1")
"""Of manylinux, from the newest that a machine of 2019 runs (glibc 2.28) down to the oldest."""
MOST_BYTES = 60_000_000


def requirements() -> list[str]:
    """What setup.cfg says that freepath needs, less what the kit leaves out."""
    config = configparser.ConfigParser()
    config.read(ROOT / "setup.cfg")
    wanted = config["options"]["install_requires"].split()
    return [one for one in wanted if not one.startswith(LEFT_OUT)]


def pip(*arguments: str) -> None:
    """Run pip, or end with what it was asked to do."""
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", *arguments]
    if subprocess.run(command, check=False).returncode:
        sys.exit(f"make kit: failed: pip {' '.join(arguments)}")


def own_wheel(wheels: Path, *options: str) -> None:
    """Build freepath's wheel from a copy: what lies in build/ of the tree would go into it."""
    with tempfile.TemporaryDirectory() as folder:
        for name in SOURCES:
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, Path(folder) / name)
        pip("wheel", "--quiet", "--no-deps", *options, "--wheel-dir", str(wheels), folder)


def without_tests(wheel: Path) -> None:
    """Leave the tests of a package out of its wheel: an eighth of scipy's."""
    smaller = wheel.with_suffix(".part")
    with zipfile.ZipFile(wheel) as old, zipfile.ZipFile(smaller, "w", zipfile.ZIP_DEFLATED) as new:
        for item in old.infolist():
            if "/tests/" not in item.filename:
                new.writestr(item, old.read(item))
    smaller.replace(wheel)


def main() -> None:
    """Make it; ends with a message where something cannot be had or the kit is too large."""
    here = f"{sys.version_info.major}.{sys.version_info.minor}"
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("output", type=Path)
    parser.add_argument("--python", default=here, help="the Python that wheels are for: 3.12")
    parser.add_argument(
        "--own-only", action="store_true", help="where all packages are there: freepath's wheel"
    )
    options = parser.parse_args()
    shutil.rmtree(options.output, ignore_errors=True)
    wheels = options.output / "wheels"
    wheels.mkdir(parents=True)
    needed = requirements()
    if options.own_only:
        own_wheel(wheels, "--no-build-isolation")
    else:
        own_wheel(wheels)
        where = ["--dest", str(wheels), "--python-version", options.python]
        for name in PLATFORMS:
            where += ["--platform", f"manylinux{name}_x86_64"]
        pip("download", "--quiet", "--only-binary", ":all:", *where, *needed, "pip")
        for wheel in wheels.glob("scipy-*.whl"):
            without_tests(wheel)
    (options.output / "requirements.txt").write_text("\n".join(needed) + "\n")
    (options.output / "python-version").write_text(f"{options.python}\n")
    for name in ("run.sh", "README.md"):
        shutil.copy(HERE / name, options.output)
    size = sum(file.stat().st_size for file in options.output.rglob("*") if file.is_file())
    print(f"{options.output}: {size / 1e6:.1f} MB, for Python {options.python}")
    if size > MOST_BYTES:
        sys.exit(f"make kit: {options.output} is larger than {MOST_BYTES / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
