"""Reports of results: a page, pictures, Markdown and text, from CSV files and run.json alone."""

from freepath.report.data import Report, load
from freepath.report.writing import FORMATS, write

__all__ = ["FORMATS", "Report", "load", "write"]
