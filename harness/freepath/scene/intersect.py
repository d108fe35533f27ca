"""Where rays are inside a medium's box."""

from __future__ import annotations

import numpy as np

from freepath.scene.media.base import Array, Medium


def segments(origins: Array, directions: Array, medium: Medium) -> Array:
    """Return the parts of rays inside the medium's box, as (N, 7) in medium coordinates.

    `origins` and `directions` are (N, 3) in the world, the directions of length 1. Columns: the
    point of entry, the direction per unit of world length, the length in the world. A ray that
    starts inside enters where it starts; one that misses, or only touches an edge or a corner, has
    length 0 and some point of the box. A ray that runs along a face is inside.

    The slab method of Kay and Kajiya 1986, with the intervals of axes on which the ray stands still
    set by hand: 0 / 0 says nothing about them.
    """
    start = origins @ medium.to_medium[:, :3].T + medium.to_medium[:, 3]
    direction = directions @ medium.to_medium[:, :3].T
    still = direction == 0.0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        faces = -start / direction, (medium.extent - start) / direction
    inside = (start >= 0.0) & (start <= medium.extent)
    always = np.where(inside, np.inf, -np.inf)
    near = np.where(still, -always, np.minimum(*faces))
    far = np.where(still, always, np.maximum(*faces))
    enter, leave = np.maximum(near.max(axis=1), 0.0), far.min(axis=1)
    hit = leave > enter
    enter = np.where(hit, enter, 0.0)
    point = np.clip(start + enter[:, None] * direction, 0.0, medium.extent)
    # the faces that a ray enters through hold exactly
    at_face = hit[:, None] & (near == enter[:, None]) & ~still & (enter > 0.0)[:, None]
    point = np.where(at_face, np.where(direction > 0.0, 0.0, medium.extent), point)
    length = np.where(hit, leave - enter, 0.0)
    return np.column_stack([point, direction, length])
