"""`freepath source`: the OpenCL C of a case."""

from __future__ import annotations

import sys
from argparse import Namespace
from typing import TYPE_CHECKING, Any

from freepath.commands.arguments import add_config, add_device
from freepath.commands.common import cases_of
from freepath.errors import USAGE, ConfigError, NothingMatchedError, Problem

if TYPE_CHECKING:
    from freepath.cases.plan import Case


def add(commands: Any) -> None:
    """Declare its arguments."""
    source = commands.add_parser(
        "source",
        help="show the OpenCL C of a case",
        description="Print the OpenCL C that a case is composed of, as its device builds it.",
        allow_abbrev=False,
    )
    add_config(source)
    source.add_argument("--case", type=int, metavar="N", help="number of the case in `run -N`")
    add_device(source, "a device whose lanes `auto` stands for")


def execute(options: Namespace) -> int:
    """Run it; returns the exit code."""
    loaded, known, cases = cases_of(options)
    case = _chosen(options, cases)
    from freepath.compose import source
    from freepath.device.selection import one_device
    from freepath.measure import binding
    from freepath.scene import build_medium

    if case.skip_reason:
        print(f"freepath: {case.name} has no source: {case.skip_reason}", file=sys.stderr)
        return USAGE
    device = one_device(options.device)
    medium = build_medium(case.medium, loaded.search_path)
    structure = binding.structure_of(case, known, medium, device, count=False)
    print(source.compose(structure).text)
    return 0


def _chosen(options: Namespace, cases: list[Case]) -> Case:
    """The case of --case, or the only one that the filters leave."""
    if options.case is None:
        if len(cases) > 1:
            message = f"expected --case N: {len(cases)} cases match"
            raise ConfigError([Problem(options.config, 0, 0, "", message)])
        return cases[0]
    for case in cases:
        if case.index == options.case:
            return case
    raise NothingMatchedError(
        f"no case {options.case} among {len(cases)}; see `freepath run {options.config} -N`"
    )
