"""Files that name the libraries of OpenCL drivers (.icd), and libraries that came with packages."""

from __future__ import annotations

import os
import sys
from importlib import metadata
from pathlib import Path

VENDORS = (Path("/etc/OpenCL/vendors"), Path(sys.prefix) / "etc" / "OpenCL" / "vendors")
"""Where systems and environments keep .icd files, each with the name of a driver's library."""
KNOWN = ("libpocl", "libintelocl", "fpga_emu", "libRusticlOpenCL")
"""What is in the names of libraries that belong to known drivers."""
LIBRARIES = tuple(
    map(Path, ("/usr/lib/x86_64-linux-gnu", "/usr/lib64", "/usr/lib", "/usr/local/lib"))
)
"""Where a library that an .icd file names without a path is looked for, to know its version."""


def icd_files() -> dict[Path, str]:
    """The .icd files of the system and the environment, each with the library that it names."""
    chosen = os.environ.get("OCL_ICD_VENDORS", "")
    folders = [*VENDORS, *([Path(chosen)] if Path(chosen).is_dir() and chosen else [])]
    found = {}
    for file in (file for folder in folders for file in sorted(folder.glob("*.icd"))):
        try:
            found[file] = file.read_text("utf-8", "replace").strip()
        except OSError:
            continue
    return found


def is_there(library: str) -> bool:
    """Tell whether a library that an .icd file names is there; the linker looks for a bare name."""
    if "/" in library:
        return Path(library).exists()
    further = filter(None, os.environ.get("LD_LIBRARY_PATH", "").split(os.pathsep))
    return any((folder / library).exists() for folder in (*LIBRARIES, *map(Path, further)))


def in_icd_files(library: str) -> str:
    """The library that an .icd file names and that is there, by a part of its name; or ''."""
    # Intel's wheel names a path that is not there
    named = (name for name in icd_files().values() if library in name)
    return next((name for name in named if "/" not in name or Path(name).exists()), "")


def in_package(package: str, library: str) -> str:
    """The path of a library that came with a package of pip, or ''."""
    try:
        files = metadata.files(package) or []
    except metadata.PackageNotFoundError:
        return ""
    found = (Path(file.locate()).resolve() for file in files if file.name == library)
    return next((str(path) for path in found if path.exists()), "")


def strangers() -> dict[Path, str]:
    """The .icd files that belong to no known driver, each with the library that it names."""
    return {f: name for f, name in icd_files().items() if not any(one in name for one in KNOWN)}
