"""Whether a device computes what it should: the checks of `freepath check` and of the tests.

A check is defined once, in `suite`, and run by either; a new one comes with a planted defect that
only it sees. What checks need is here too: media and rays, exact values, and shared error budgets.
"""
