"""The OpenCL C of a case: trackers and their front matter, and the files that a case needs.

Text in, text out: nothing here is compiled. A new tracker or medium needs no change here; a file
of kernels/ that is renamed or moved does.
"""
