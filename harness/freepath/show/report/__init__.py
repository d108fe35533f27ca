"""Reports of results: a page, pictures, Markdown, LaTeX and text, from CSV files and run.json."""

from freepath.show.report.data import Report, load
from freepath.show.report.writing import FORMATS, STANDARD_OUTPUT, TEXTS, Choice, made, write

__all__ = ["FORMATS", "STANDARD_OUTPUT", "TEXTS", "Choice", "Report", "load", "made", "write"]
