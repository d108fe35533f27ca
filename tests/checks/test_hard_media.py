"""Empty and full, thin and thick, majorants and controls."""

from checks.support import those

GROUPS = ("empty-full", "thin", "thick", "non-bounding", "loose", "residual")
test_check = those(*(f"hard/{group}/" for group in GROUPS))
