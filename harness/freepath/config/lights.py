"""The kinds of light that a config may name, for the estimand radiance."""

from typing import Annotated, ClassVar

from freepath.config.base import Kind
from freepath.config.models import Factor, Point, by_kind
from freepath.config.rules import OneOrMore, Text

Spectrum = Annotated[tuple[Factor, ...], OneOrMore()]


class Dark(Kind):
    """No light but what the medium emits."""

    kind: ClassVar[str] = "dark"


class Uniform(Kind):
    """An environment that is the same from all directions."""

    kind: ClassVar[str] = "uniform"
    radiance: Spectrum = (1.0,)
    """Its radiance; one number, or one a channel."""


class PointLight(Kind):
    """A point that shines alike in all directions, also inside the medium."""

    kind: ClassVar[str] = "point"
    position: Point
    """Where it is, in the world."""
    intensity: Spectrum = (1.0,)
    """Radiant intensity (power per solid angle); one number, or one a channel."""


class PointInEnvironment(PointLight):
    """A point before an environment that is the same from all directions."""

    kind: ClassVar[str] = "point_in_environment"
    radiance: Spectrum = (1.0,)
    """The environment's radiance; one number, or one a channel."""


class Image(Kind):
    """An environment from an image by latitude and longitude, with +z at its top."""

    kind: ClassVar[str] = "image"
    file: Annotated[str, Text("a file name")]
    """Of floating-point numbers; looked for beside the config, then in $FREEPATH_VOLUMES."""
    scale: Factor = 1.0
    """Makes radiance of its values."""


class PointInImage(PointLight):
    """A point before an environment from an image."""

    kind: ClassVar[str] = "point_in_image"
    file: Annotated[str, Text("a file name")]
    """The image: see `image`."""
    scale: Factor = 1.0
    """Makes radiance of its values."""


LIGHTS = by_kind(Dark, Uniform, PointLight, PointInEnvironment, Image, PointInImage)
