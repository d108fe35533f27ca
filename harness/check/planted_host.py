"""Defects of what the host prepares for the kernels: a function of the package, and a wrong one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple
from unittest import mock

from freepath.check.planted import HARD, ID
from freepath.scene.cells import supporting_voxels


class HostDefect(NamedTuple):
    """A slip of a hand: what it is, the function it is in, what that does instead, who sees it."""

    what: str
    function: str
    """Where it is looked up, as module.name."""
    wrong: Callable[..., Any]
    check: str


@contextmanager
def planted(defect: HostDefect) -> Iterator[mock.Mock]:
    """Put the wrong function in the right one's place; the mock tells whether it was called."""
    with mock.patch(defect.function, side_effect=defect.wrong, autospec=True) as called:
        yield called


def _without_halo(voxels: int, count: int, trilinear: bool) -> Any:
    """Only the voxels that a cell covers, although interpolation reaches half a voxel further."""
    return supporting_voxels(voxels, count, False)


BOUNDS = "freepath.scene.grid.supporting_voxels"
HOST = (
    HostDefect(
        "a majorant without halo", BOUNDS, _without_halo, f"{ID}/delta/free_path/trilinear/octree"
    ),
    HostDefect(
        "a majorant without halo, and so a cell that is taken for an empty one",
        BOUNDS,
        _without_halo,
        f"{HARD}/empty-full/one-voxel/ratio",
    ),
)
