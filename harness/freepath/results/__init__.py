"""The folder of a run: its CSV files, run.json, and what their columns mean.

The only way between measuring and showing. A column that is renamed or changes its meaning takes a
new schema version: results of before are refused, with a message that says so.
"""
