"""The name of the CPU that PoCL's wheel compiles for, mended where its compiler refuses it.

The wheel (driver version 3.0-rc2, LLVM 14) calls a CPU that it does not know `generic`, which its
clang then refuses as a target: nothing can be built on CPUs since 2022, such as Zen 5. The wheel
takes no option against it. What helps is to name a CPU that it knows, in the string that its device
holds, before the first build. The name must be one that has all that PoCL's library of built-ins
was compiled for (it chose that by the CPU's features), and no more than the CPU has.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path

VERSION = "3.0-rc2"
"""The only driver version whose device is known to look so."""
OFFSET = 640
"""Bytes from the beginning of the device's structure to the pointer to the CPU's name."""
UNKNOWN = b"generic"
NAMES = (
    ("avx512", "skx", ("avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl", "fma", "avx2")),
    ("avx2", "haswell", ("avx2", "fma", "bmi1", "bmi2", "f16c", "movbe", "abm")),
    ("avx_fma4", "bdver1", ("avx", "fma4", "xop")),
    ("avx_f16c", "btver2", ("avx", "f16c", "movbe", "bmi1")),
    ("sse41", "penryn", ("sse4_1", "ssse3")),
    ("ssse3", "core2", ("ssse3",)),
    ("sse2", "x86-64", ("sse2",)),
)
"""PoCL's libraries of built-ins, the best first; a CPU that LLVM 14 knows, with a name no longer
than the one that it replaces; what /proc/cpuinfo must list for it."""


def name_for(flags: set[str]) -> str:
    """The CPU to compile for, by the features of /proc/cpuinfo; '' where none fits."""
    return next((name for _, name, needed in NAMES if flags.issuperset(needed)), "")


def cpu_flags(path: str = "/proc/cpuinfo") -> set[str]:
    """What the CPU can do, as Linux lists it; empty where it does not."""
    try:
        lines = Path(path).read_text("utf-8", "replace").splitlines()
    except OSError:
        return set()
    return next(
        (set(line.partition(":")[2].split()) for line in lines if line[:5] == "flags"), set()
    )


def mend(version: str, address: int, flags: Callable[[], set[str]] = cpu_flags) -> str:
    """Replace the name of an unknown CPU in the device at an address; returns the new one, or ''.

    Only for the driver version whose structure is known, and only where the string is the one that
    its compiler refuses; otherwise all is left alone.
    """
    if version != VERSION:
        return ""
    pointer = ctypes.c_void_p.from_address(address + OFFSET).value
    if not pointer or ctypes.string_at(pointer, len(UNKNOWN) + 1) != UNKNOWN + b"\0":
        return ""
    name = name_for(flags())
    ctypes.memmove(pointer, name.encode() + b"\0", len(name) + 1 if name else 0)
    return name
