"""What is in the scene, in float64: media, rays, lights, and the values that a run should return.

Pure numpy and scipy. It is the truth that kernels are held to, so nothing here follows a kernel; a
new medium is a file in `media`, a format of volumes one in `volumes`.
"""

from freepath.scene.build import build_medium
from freepath.scene.intersect import segments
from freepath.scene.lights.radiance import path_reference
from freepath.scene.lights.sky import Sky, read_sky
from freepath.scene.media.base import Medium
from freepath.scene.rays import make_rays
from freepath.scene.references import reference

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
