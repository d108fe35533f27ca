"""Variances and costs."""

from checks.support import those

test_check = those("moments/", "lookups/as-derived/")
