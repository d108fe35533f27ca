"""Volumes from files: formats and what can be wrong with them."""
