"""freepath: what accuracy costs in time, for samplers of distance and transmittance."""

from importlib import import_module
from typing import Any

__version__ = "0.2.0"

__all__ = ["__version__", "load", "run"]


def __getattr__(name: str) -> Any:
    """Load `run` and `load` when they are first asked for: they need far more than a version."""
    if name in ("run", "load"):
        return getattr(import_module("freepath.api"), name)
    raise AttributeError(f"module 'freepath' has no attribute '{name}'")
