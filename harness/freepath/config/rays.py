"""The kinds of rays that a config may name, with their parameters."""

from typing import Annotated, ClassVar

from pydantic import ValidationInfo, field_validator

from freepath.config.base import Kind
from freepath.config.models import Direction, Image, Point, by_kind
from freepath.config.quantity import Number
from freepath.config.rules import Text, failure

MOST_CHORDS = 10_000_000
UPWARD = (0.0, 0.0, 1.0)


class Orthographic(Kind):
    """Parallel rays that frame the medium."""

    kind: ClassVar[str] = "orthographic"
    resolution: Image = (64, 64)
    """Rays across and down."""
    direction: Direction = UPWARD
    """Where the rays go."""


class Perspective(Kind):
    """Rays from a pinhole camera."""

    kind: ClassVar[str] = "perspective"
    resolution: Image = (64, 64)
    """Rays across and down."""
    position: Point
    """Where the camera stands."""
    look_at: Point
    """The point in the middle of the image."""
    field_of_view: Annotated[float, Number(above=0, below=180)] = 45.0
    """Vertical angle of view in degrees."""

    @field_validator("look_at", mode="after")
    @classmethod
    def _elsewhere(cls, point: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        if point == info.data.get("position"):
            raise failure("expected a point other than position, got the same one")
        return point


class Chords(Kind):
    """Random chords of the box, isotropic and uniform (mu-random), from the config's seed."""

    kind: ClassVar[str] = "chords"
    count: Annotated[int, Number("count", minimum=1, maximum=MOST_CHORDS)]
    """How many."""


class Single(Kind):
    """One ray."""

    kind: ClassVar[str] = "single"
    origin: Point
    """Where it starts."""
    direction: Direction
    """Where it goes."""


class File(Kind):
    """Rays from a .npy of shape (N, 6) or a .csv with the header origin_x ... direction_z."""

    kind: ClassVar[str] = "file"
    path: Annotated[str, Text("a file name")]
    """Looked for beside the config, then in $FREEPATH_VOLUMES."""


RAYS = by_kind(Orthographic, Perspective, Chords, Single, File)
