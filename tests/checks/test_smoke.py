"""A few paths of each tracker."""

from checks.support import those

test_check = those("smoke/")
