"""Free paths follow their distribution, and end where their depths are reached."""

from checks.support import those

test_check = those("distribution/", "inversion")
