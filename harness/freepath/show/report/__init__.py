"""Reports of results: a page, pictures, Markdown and text, from CSV files and run.json alone."""

from freepath.show.report.data import Report, load
from freepath.show.report.writing import FORMATS, STANDARD_OUTPUT, made, write

__all__ = ["FORMATS", "STANDARD_OUTPUT", "Report", "load", "made", "write"]
