"""What is in the scene, in float64: media, rays, and the values that a run should return."""

from freepath.scene.build import build_medium
from freepath.scene.intersect import segments
from freepath.scene.medium import Medium
from freepath.scene.radiance import path_reference
from freepath.scene.rays import make_rays
from freepath.scene.references import reference
from freepath.scene.sky import Sky, read_sky

__all__ = [
    "Medium",
    "Sky",
    "build_medium",
    "make_rays",
    "path_reference",
    "read_sky",
    "reference",
    "segments",
]
