"""freepath: what accuracy costs in time, for samplers of distance and transmittance."""

from freepath.version import __version__

__all__ = ["__version__"]
