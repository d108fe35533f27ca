"""Paths that scatter, and channels."""

from checks.support import those

test_check = those("hard/scattering/", "hard/channels/")
