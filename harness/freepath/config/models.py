"""The kinds of media and majorants that a config may name, with their parameters."""

import math
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, ValidationInfo, field_validator

from freepath.config.base import Kind
from freepath.config.quantity import Number
from freepath.config.rules import Choice, Exactly, OneOrMore, Several, Text, expected, failure

LARGEST_SEED = 2**64 - 1
LARGEST_GRID = 1024
MOST_CELLS = 2**27
LARGEST_IMAGE = 4096
MOST_CHANNELS = 32
PHASES = {"henyey_greenstein": "g", "rod": "", "rayleigh": "", "cornette_shanks": "g"}
PHASES |= {"draine": "g alpha"}
"""Each with its parameters."""
RAW = r"([1-9]\d{0,9}x){2}[1-9]\d{0,9} (u?int8|(u?int(16|32|64)|float(16|32|64)) (little|big))"
RAW_EXPECTED = "voxels along x, y, z, a type and a byte order, such as '256x256x64 uint16 little'"

CLOSED_FORM = frozenset({"closed_form"})
CELLS = frozenset({"cells"})


def _not_zero(direction: tuple[float, ...]) -> tuple[float, ...]:
    if not any(direction):
        raise failure("expected a direction that is not zero, got [0, 0, 0]")
    return direction


def _not_too_many(resolution: tuple[int, ...]) -> tuple[int, ...]:
    cells = math.prod(resolution)
    if cells > MOST_CELLS:
        raise failure(f"expected at most {MOST_CELLS} cells, got {cells}")
    return resolution


def _counted(channels: int) -> str:
    return "one value" if channels == 1 else f"one value or {channels}, one a channel"


def _power_of_two(count: int) -> int:
    if count & (count - 1):
        raise failure(f"expected a power of two, got {count}")
    return count


Length = Annotated[float, Number("length")]
Side = Annotated[float, Number("length", above=0)]
Extinction = Annotated[float, Number("1/length", minimum=0)]
Real = Annotated[float, Number()]
Seed = Annotated[int, Number("count", minimum=0, maximum=LARGEST_SEED)]
Cells = Annotated[int, Number("count", minimum=1)]
Pixels = Annotated[int, Number("count", minimum=1, maximum=LARGEST_IMAGE)]
Fraction = Annotated[float, Number("fraction", above=0, maximum=1)]
Shares = Annotated[
    tuple[Annotated[float, Number("fraction", minimum=0, maximum=1)], ...], OneOrMore()
]
Factor = Annotated[float, Number(minimum=0)]

Point = Annotated[tuple[Length, Length, Length], Exactly()]
Direction = Annotated[tuple[Real, Real, Real], Exactly(), AfterValidator(_not_zero)]
Size = Annotated[tuple[Side, Side, Side], Exactly(spread=True)]
CellCounts = Annotated[
    tuple[Cells, Cells, Cells], Exactly(spread=True), AfterValidator(_not_too_many)
]
Image = Annotated[tuple[Pixels, Pixels], Exactly(("width", "height"), spread=True)]
Interpolation = Annotated[Literal["trilinear", "nearest"], Choice(("trilinear", "nearest"))]

UNIT_CUBE = (1.0, 1.0, 1.0)


class Medium(Kind):
    """A medium; OFFERS says what a tracker may ask of it beside sigma_t at a point."""

    OFFERS: ClassVar[frozenset[str]] = frozenset()
    LATER: ClassVar[frozenset[str]] = frozenset({"alpha"})
    VOXELS: ClassVar[bool] = False
    """Whether its extinction is stored voxel by voxel."""
    channels: Annotated[tuple[Factor, ...], Several(2, MOST_CHANNELS)] | None = None
    """Extinction of each channel relative to sigma_t, of two or more; grey if left out."""
    albedo: Shares = (0.0,)
    """Share of the extinction that scatters, of radiance; one number, or one a channel."""
    emission: Annotated[tuple[Factor, ...], OneOrMore()] = (0.0,)
    """Radiance of the source where the medium absorbs; one number, or one a channel."""
    phase: Annotated[str, Choice(tuple(PHASES))] = "henyey_greenstein"
    """Where it scatters to; rod is forward or backward along the ray."""
    g: Annotated[float, Number("fraction", above=-1, below=1)] = 0.0
    """Mean cosine of henyey_greenstein, 0 is isotropic; of cornette_shanks and draine its share."""
    alpha: Annotated[float, Number(minimum=0, maximum=1000)] = 1.0
    """Weight of the squared cosine, of draine: 0 is henyey_greenstein, 1 cornette_shanks."""

    @field_validator("albedo", "emission", mode="after")
    @classmethod
    def _a_value_a_channel(cls, values: tuple[float, ...], info: ValidationInfo) -> Any:
        channels = len(info.data.get("channels") or (1,))
        if len(values) not in (1, channels):
            raise failure(f"expected {_counted(channels)}, got {len(values)}")
        return values

    @field_validator("g", "alpha", mode="after")
    @classmethod
    def _of_its_phase(cls, value: float, info: ValidationInfo) -> float:
        phase = info.data.get("phase", "draine")
        if value and info.field_name not in PHASES[phase].split():
            raise failure(f"expected no {info.field_name} with phase: {phase}, got {value:g}")
        return value

    @property
    def channel_count(self) -> int:
        """How many channels a path may follow; 1 of a grey medium."""
        return len(self.channels or (1,))


class Box(Medium):
    """A medium with a closed form in the box [0, size]."""

    OFFERS: ClassVar[frozenset[str]] = CLOSED_FORM


class Homogeneous(Box):
    """The same extinction everywhere."""

    kind: ClassVar[str] = "homogeneous"
    OFFERS: ClassVar[frozenset[str]] = CLOSED_FORM | CELLS
    sigma_t: Extinction
    """Extinction."""
    size: Size = UNIT_CUBE
    """Sides of the box."""


class Linear(Box):
    """Extinction that changes linearly with the height."""

    kind: ClassVar[str] = "linear"
    bottom: Extinction
    """Extinction at z = 0."""
    top: Extinction
    """Extinction at the top of the box."""
    size: Size = UNIT_CUBE
    """Sides of the box."""


class Exponential(Box):
    """An atmosphere: sigma_t * exp(-z / scale_height)."""

    kind: ClassVar[str] = "exponential"
    sigma_t: Extinction
    """Extinction at z = 0."""
    scale_height: Side
    """Height in which the extinction falls to 1/e."""
    size: Size = UNIT_CUBE
    """Sides of the box."""


class Gaussian(Box):
    """A blob: sigma_t * exp(-r^2 / (2 width^2)), r from the centre."""

    kind: ClassVar[str] = "gaussian"
    sigma_t: Extinction
    """Extinction at the centre."""
    width: Side
    """Standard deviation."""
    center: Point | None = None
    """Centre of the blob; the middle of the box if left out."""
    size: Size = UNIT_CUBE
    """Sides of the box."""


class Cosine(Box):
    """Waves: sigma_t * (1 + amplitude * cos(2 pi periods z / height + phase))."""

    kind: ClassVar[str] = "cosine"
    sigma_t: Extinction
    """Mean extinction."""
    amplitude: Annotated[float, Number("fraction", minimum=0, maximum=1)]
    """Amplitude relative to the mean."""
    periods: Annotated[float, Number(above=0)]
    """Periods over the height of the box."""
    phase: Real = 0.0
    """Phase in radians at z = 0."""
    size: Size = UNIT_CUBE
    """Sides of the box."""


class Layered(Box):
    """Layers of constant extinction, from the bottom to the top."""

    kind: ClassVar[str] = "layered"
    OFFERS: ClassVar[frozenset[str]] = CLOSED_FORM | CELLS
    size: Size = UNIT_CUBE
    """Sides of the box."""
    breakpoints: Annotated[tuple[Side, ...], OneOrMore()]
    """Heights between the layers, ascending, inside the box."""
    values: Annotated[tuple[Extinction, ...], OneOrMore()]
    """Extinctions of the layers: one more than breakpoints."""

    @field_validator("breakpoints", mode="after")
    @classmethod
    def _ascend(cls, heights: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        top = info.data.get("size", (0, 0, float("inf")))[2]
        for low, high in zip(heights, (*heights[1:], top), strict=True):
            if low >= high:
                limit = f"below the top of the box at {top:g}" if high == top else "ascending"
                raise failure(f"expected heights that are {limit}, got {low:g} before {high:g}")
        return heights

    @field_validator("values", mode="after")
    @classmethod
    def _count(cls, values: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        layers = len(info.data.get("breakpoints", values[1:])) + 1
        if len(values) != layers:
            raise expected(f"{layers} values (one more than breakpoints)", values)
        return values


class Cloud(Medium):
    """A procedural cloud on a grid of cubes, the same for the same seed and resolution."""

    kind: ClassVar[str] = "cloud"
    OFFERS: ClassVar[frozenset[str]] = CELLS
    VOXELS: ClassVar[bool] = True
    resolution: Annotated[int, Number("count", minimum=2, maximum=LARGEST_GRID)]
    """Voxels along each side."""
    seed: Seed = 1
    """Which cloud."""
    sigma_t: Extinction = 1.0
    """Scales the density, whose maximum is 1."""
    floor: Annotated[float, Number("fraction", minimum=0, maximum=1)] = 0.0
    """Share of a homogeneous part: the density is floor + (1 - floor) x cloud."""
    interpolation: Interpolation = "trilinear"
    """How the density is read between voxel centres."""
    size: Size = UNIT_CUBE
    """Sides of the box."""


class Volume(Medium):
    """A grid from a file, in any of the formats that docs/files.md lists."""

    kind: ClassVar[str] = "volume"
    OFFERS: ClassVar[frozenset[str]] = CELLS
    VOXELS: ClassVar[bool] = True
    file: Annotated[str, Text("a file name")]
    """Looked for beside the config, then in $FREEPATH_VOLUMES."""
    sigma_t: Extinction = 1.0
    """Scales the density."""
    grid: Annotated[str, Text("the name of a grid", blank=True)] | None = None
    """Which grid of an OpenVDB file; '' is one without a name, NAME[1] the second of a name."""
    raw: Annotated[str, Text(RAW_EXPECTED, RAW)] | None = None
    """Of raw numbers: voxels along x (fastest), y, z, type, byte order ('8x9x10 uint16 big')."""
    interpolation: Interpolation = "trilinear"
    """How the density is read between voxel centres."""
    voxel_size: Size | None = None
    """Sides of a voxel; overrides what the file says (which is 1 where it says nothing)."""


class Global(Kind):
    """One majorant for the whole medium."""

    kind: ClassVar[str] = "global"


class Grid(Kind):
    """A majorant for each cell of a regular grid, walked by DDA."""

    kind: ClassVar[str] = "grid"
    resolution: CellCounts
    """Cells along each side, one number or three."""


class Octree(Kind):
    """A majorant for each leaf of an octree, which joins cells of like majorants."""

    kind: ClassVar[str] = "octree"
    resolution: Annotated[
        int, Number("count", minimum=2, maximum=512), AfterValidator(_power_of_two)
    ]
    """Finest cells along each side, a power of two."""
    slack: Annotated[float, Number(minimum=0)] = 0.25
    """Eight leaves are joined if that raises the integral of the majorant by at most so much."""


def by_kind(*models: type[Kind]) -> dict[str, type[Kind]]:
    """Return models by the names that a config gives them."""
    return {model.kind: model for model in models}


MEDIA = by_kind(Homogeneous, Linear, Exponential, Gaussian, Cosine, Layered, Cloud, Volume)
MAJORANTS = by_kind(Global, Grid, Octree)
