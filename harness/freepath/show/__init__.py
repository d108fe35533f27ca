"""What is made of results: tables, charts, the page, comparisons, lists.

Reads the CSV of a run and nothing else, so it works on results of other machines. No number is
measured here, and none that a row has is computed again.
"""
