"""Measuring: a sweep's cases in interleaved rounds, until their errors and times are known.

From a case and a device to a row: binding, runner, rounds, statistics, stopping. `stats` and
`stopping` are pure and have closed-form tests; change them only with those at hand.
"""
