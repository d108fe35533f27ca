"""Configs: what may be written in them, and how they are found, read and checked."""

from freepath.config.axes import AXES
from freepath.config.base import Kind
from freepath.config.loading import find, load, shipped
from freepath.config.sweep import Config

__all__ = ["AXES", "Config", "Kind", "find", "load", "shipped"]
