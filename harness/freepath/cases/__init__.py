"""The cases of a config: which points of its matrix mean something, their names and their order.

Pure: from config and catalog to a list of cases, and no device is asked. A rule that refuses or
joins cases goes here; what an axis may be is in config, what a case costs in measure.
"""
