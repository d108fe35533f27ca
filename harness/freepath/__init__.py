"""freepath: what accuracy costs in time, for samplers of distance and transmittance."""

from importlib import import_module
from typing import Any

__version__ = "0.2.0"

_FROM = {
    "run": "api",
    "load": "api",
    "compare": "api",
    "recommend": "extras.recommend",
    "try_tracker": "extras.candidate",
}
__all__ = ["__version__", "compare", "load", "recommend", "run", "try_tracker"]


def __getattr__(name: str) -> Any:
    """Load what is asked for when it is: that needs far more than a version does."""
    if name in _FROM:
        return getattr(import_module(f"freepath.{_FROM[name]}"), name)
    raise AttributeError(f"module 'freepath' has no attribute '{name}'")
