"""Paths that scatter, channels, and chances of absorption."""

from checks.support import those

test_check = those("hard/scattering/", "hard/channels/", "hard/p_absorb/")
