"""Configs: what may be written in them, and how they are found, read and checked.

A model for each kind of thing, rules for its fields, and messages with line and key. New keys and
axes begin here; nothing here knows a kernel, a device or a result.
"""

from freepath.config.axes import AXES
from freepath.config.base import Kind
from freepath.config.loading import find, load, shipped
from freepath.config.sweep import Config

__all__ = ["AXES", "Config", "Kind", "find", "load", "shipped"]
