"""Random numbers, accumulation, long runs, bad input."""

from checks.support import those

GROUPS = ("random-numbers", "accumulation", "long-runs", "bad-input")
test_check = those(*(f"hard/{group}/" for group in GROUPS))
