"""Whether a device computes what it should: the checks of `freepath check` and of the tests.

A check is defined once, in `suite`, and run by either. What it needs is here too: media and rays,
exact values, and tests that share out a chance of rejecting a right kernel.
"""
