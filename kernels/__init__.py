"""OpenCL C sources, composed at run time (see README.md beside this file)."""
