"""Geometry, scale and contrast."""

from checks.support import those

GROUPS = ("geometry", "scale", "contrast")
test_check = those(*(f"hard/{group}/" for group in GROUPS))
