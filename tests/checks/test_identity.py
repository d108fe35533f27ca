"""Every tracker x medium x majorant x estimand agrees with float64 in the mean."""

from checks.support import those

test_check = those("identity/")
