"""Composes the OpenCL C of a case from the files that it needs, and from no other."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from freepath.compose import kernel_files
from freepath.compose.kernel_files import KernelFile, TrackerFile, taken
from freepath.compose.light_paths import SKY_COLUMNS, SKY_ROWS, Effects
from freepath.config.axes import ALONG_PATHS
from freepath.errors import CatalogError

SCALARS = {"strict": "float", "fast": "float", "double": "double"}
BUILD_OPTIONS = {
    "strict": ("-cl-single-precision-constant",),
    "fast": ("-cl-single-precision-constant", "-cl-fast-relaxed-math"),
    "double": (),
}
BOX = ("extent_x", "extent_y", "extent_z")


@dataclass(frozen=True)
class Structure:
    """All that decides which source a case has; numbers are kernel arguments and do not."""

    tracker: TrackerFile
    needs: frozenset[str]
    """Of the tracker, and of the one of its shadow rays."""
    estimand: str
    medium: str
    medium_numbers: tuple[str, ...]
    majorant: str | None
    majorant_numbers: tuple[str, ...]
    lanes: int
    arithmetic: str
    storage: str = "float"
    """How the voxels of a grid are stored: float or half."""
    channels: int = 1
    chromatic: bool = False
    """Whether a path has a weight for each channel, be it one; or one weight."""
    paths: Effects | None = None
    """What happens along paths that scatter; None where a sample is one flight."""
    logarithm: str = "polynomial"
    count: bool = False
    record: bool = False

    @property
    def trackers(self) -> list[TrackerFile]:
        """The tracker, and that of its shadow rays."""
        shadow = self.paths.shadow if self.paths else None
        return [self.tracker, shadow] if shadow else [self.tracker]


@dataclass(frozen=True)
class Source:
    """Composed OpenCL C, the options to build it with, and a hash of both."""

    text: str
    options: tuple[str, ...]

    def unoptimised(self) -> Source:
        """The same to be built in less time and to run slower."""
        return Source(self.text, (*self.options, "-cl-opt-disable"))

    @property
    def sha256(self) -> str:
        """Identifies the source and its options."""
        return combined_hash(self.text, *self.options)


def combined_hash(*parts: str | bytes) -> str:
    """Sha256 over several texts or arrays' bytes, in hexadecimal."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(hashlib.sha256(part.encode() if isinstance(part, str) else part).digest())
    return digest.hexdigest()


def compose(structure: Structure) -> Source:
    """Concatenate the files of a case, each behind a `#line` that names it to the compiler."""
    parts = [_defines(structure)]
    parts += _named(kernel_files.read(name) for name in _before_structs(structure))
    uses = [name for tracker in structure.trackers for name in tracker.uses]
    uses += structure.paths.uses if structure.paths else ()
    walks = _with_uses([*_walks(structure), *uses])
    channels = kernel_files.read(f"score/channels_{'several' if structure.chromatic else 'one'}")
    parts.append(_structs(structure, [*walks, channels]))
    estimand = "along_paths" if structure.estimand in ALONG_PATHS else structure.estimand
    middle = [f"score/{estimand}", "score/count_on" if structure.count else "score/count_off"]
    middle += ["media/storage_half"] if structure.storage == "half" else []
    middle += [f"media/{structure.medium}", "lanes/path"]
    files = [*(kernel_files.read(name) for name in middle), channels, *walks]
    parts += _named(_as_stored(file, structure) for file in files)
    paths, exact = structure.paths, structure.arithmetic == "double"
    parts += _named(paths.around_tracker(exact=exact) if paths else structure.tracker.files())
    record = "score/record_samples" if structure.record else "score/record_nothing"
    parts += _named(kernel_files.read(name) for name in ("score/tally", record, "main"))
    return Source("\n".join(parts), BUILD_OPTIONS[structure.arithmetic])


def _before_structs(structure: Structure) -> list[str]:
    lanes = "lanes/scalar" if structure.lanes == 1 else "lanes/vector"
    exact = structure.arithmetic == "double" or structure.logarithm == "builtin"
    logarithm = "math/log_builtin" if exact else "math/log_polynomial"
    return [lanes, "lanes/common", logarithm, "lanes/rng", "lanes/ray"]


def _walks(structure: Structure) -> list[str]:
    walks = []
    if "majorant" in structure.needs:
        walk = "control" if "control" in structure.needs else "majorant"
        cells = structure.majorant != "global"
        walks += [f"walk/{structure.majorant}"] if cells else []
        walks.append(f"walk/{walk}_{'cell_by_cell' if cells else 'global'}")
    needed = (need for need in ("closed_form", "cells") if need in structure.needs)
    return walks + [f"media/{need}_{structure.medium}" for need in needed]


def _with_uses(names: Iterable[str]) -> list[KernelFile]:
    """The files and, before each, those that it uses, each once."""
    found: dict[str, KernelFile] = {}

    def add(name: str) -> None:
        if name not in found:
            file = kernel_files.read(name)
            for used in file.uses:
                add(used)
            found[name] = file

    for name in names:
        add(name)
    return list(found.values())


def _named(files: Iterable[KernelFile]) -> list[str]:
    return [f'#line 1 "{file.name}"\n{_without_blank_head(file.code)}' for file in files]


def _as_stored(file: KernelFile, structure: Structure) -> KernelFile:
    """A file as it reads the voxels of a grid in their storage; all that is float is as it stands.

    OpenCL 1.x has no overloaded functions, and a pointer says its type where it is declared.
    """
    reads_voxels = file.name.startswith("media/")
    if structure.storage == "float" or not reads_voxels:
        return file
    code = re.sub(r"\bgather\(", "gather_half(", file.code)
    return replace(file, code=code.replace("__global const float *", "__global const half *"))


def _without_blank_head(code: str) -> str:
    """Leave out the empty lines that stand for front matter, by starting at a later line."""
    head = re.match(r"\n*", code).group()
    return code if not head else f"#line {len(head) + 1}\n{code[len(head) :]}"


def _defines(structure: Structure) -> str:
    scalar = SCALARS[structure.arithmetic]
    double = scalar == "double"
    lines = [
        f"#define LANES {structure.lanes}",
        f"#define CHANNELS {structure.channels}",
        f"#define SCALAR {scalar}",
        f"#define INTEGER {'long' if double else 'int'}",
        f"#define ROUNDING {'2.220446049250313e-16' if double else '1.1920929e-7f'}",
    ]
    if _has_sky(structure):
        lines += [f"#define SKY_ROWS {SKY_ROWS}", f"#define SKY_COLUMNS {SKY_COLUMNS}"]
    if double:
        lines.insert(0, "#pragma OPENCL EXTENSION cl_khr_fp64 : enable")
    for prefix, tracker in zip(("", "SHADOW_"), structure.trackers, strict=False):
        lines += tracker.defines(prefix)
    return "\n".join(lines)


def _structs(structure: Structure, walks: list[KernelFile]) -> str:
    """Declare Numbers and Scene from the parts' numbers, State from their front matter."""
    groups = {
        "box": BOX,
        "medium": structure.medium_numbers,
        "majorant": structure.majorant_numbers if "majorant" in structure.needs else (),
        "channels": ("extinction[CHANNELS]", "largest") if structure.chromatic else (),
        "tracker": structure.tracker.numbers,
    }
    if structure.paths:
        groups |= structure.paths.groups
        shadow = structure.paths.shadow
        groups["shadow_tracker"] = shadow.numbers if shadow else ()
    groups = {group: names for group, names in groups.items() if names}
    lines = ['#line 1 "structs"']
    for group, names in groups.items():
        fields = ", ".join(names)
        lines.append(f"typedef struct {{ SCALAR {fields}; }} {_type_of(group)};")
    members = " ".join(f"{_type_of(group)} {group};" for group in groups)
    lines.append(f"typedef struct {{ {members} }} Numbers;")
    stored = "half" if structure.storage == "half" else "float"
    pointers = f"__global const {stored} *medium_data; __global const float *majorant_data;"
    medium = "medium_data" if stored == "float" else "(__global const half *)medium_data"
    data = f"{medium}, majorant_data"
    if _has_sky(structure):
        # in one buffer, so that scenes without an image have no argument for it
        pointers += " __global const float *sky_data;"
        first = "CHANNELS * (SKY_ROWS + 2) * SKY_COLUMNS"
        data = f"{medium}, majorant_data + {first}, majorant_data"
    lines.append(f"typedef struct {{ {members} {pointers} }} Scene;")
    values = "".join(f"numbers->{group}, " for group in groups)
    lines += [
        "static Scene make_scene(__constant const Numbers *numbers,",
        "                        __global const float *medium_data,",
        "                        __global const float *majorant_data)",
        "{",
        f"    const Scene scene = {{{values}{data}}};",
        "    return scene;",
        "}",
    ]
    return "\n".join(lines + _state(structure, walks))


def _has_sky(structure: Structure) -> bool:
    return structure.paths is not None and "environment_image" in structure.paths


def _type_of(group: str) -> str:
    return f"{group.title().replace('_', '')}Numbers"


def _state(structure: Structure, walks: list[KernelFile]) -> list[str]:
    """Declare what a path carries for its walk and its tracker, and how lanes take it over."""
    state = {name: kind for file in walks for name, kind in file.state.items()}
    if structure.paths:
        state |= structure.paths.state
    for tracker in structure.trackers:
        for name in sorted(dict(tracker.state).keys() & state.keys()):
            message = f"expected a name for its state other than '{name}', which freepath uses"
            raise CatalogError(f"trackers/{tracker.name}.cl: {message}")
    state |= {name: kind for tracker in structure.trackers for name, kind in tracker.state}
    lines = ["typedef struct {"]
    for name, kind in state.items():
        scalar, bracket, count = kind.replace("spectrum", "real[CHANNELS]").partition("[")
        lines.append(f"    {scalar} {name}{bracket}{count};")
    lines += [
        "} State;",
        "static void take_state(State *into, const State *from, const mask where)",
    ]
    # arrays are scratch that a sample fills as it goes: there is nothing to take over at its start
    kept = {name: kind for name, kind in state.items() if "[" not in kind}
    takes = [f"    {taken(kind, f'into->{n}', f'from->{n}')}" for n, kind in kept.items()]
    return [*lines, "{", *takes, "}"]


def numbers_of(  # noqa: PLR0913, PLR0917 (one group of the kernel's Numbers each)
    structure: Structure,
    box: list[float],
    medium: dict[str, float],
    majorant: dict[str, float],
    channels: list[float],
    tracker: dict[str, Any],
    shadow: dict[str, Any] | None = None,
) -> list[float]:
    """The values of the kernel's Numbers, in the order in which compose declares them."""
    values = [*box, *(medium[name] for name in structure.medium_numbers)]
    if "majorant" in structure.needs:
        values += [majorant[name] for name in structure.majorant_numbers]
    if structure.chromatic:
        values += [*channels, max(channels)]
    values += [tracker[name] for name in structure.tracker.numbers]
    if structure.paths:
        values += structure.paths.numbers
        if structure.paths.shadow:
            values += [shadow[name] for name in structure.paths.shadow.numbers]
    return values
