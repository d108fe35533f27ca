"""Lights: images of the environment, and the exact radiance that paths should return."""
