"""The media, majorants and rays that the tests of the kernels share, as a config writes them."""

SIZE = [1.0, 1.5, 0.75]
CLOUD = {"resolution": 16, "sigma_t": 12.0, "size": SIZE}

# Thick enough to matter and thin enough for a path to escape: an optical depth of 0 to 6.
MEDIA = {
    "homogeneous": {"homogeneous": {"sigma_t": 1.5, "size": SIZE}},
    "linear": {"linear": {"bottom": 3.0, "top": 0.5, "size": SIZE}},
    "exponential": {"exponential": {"sigma_t": 6.0, "scale_height": 0.3, "size": SIZE}},
    "gaussian": {
        "gaussian": {"sigma_t": 6.0, "width": 0.2, "center": [0.4, 0.8, 0.3], "size": SIZE}
    },
    "cosine": {
        "cosine": {"sigma_t": 2.0, "amplitude": 0.9, "periods": 2.5, "phase": 0.7, "size": SIZE}
    },
    # An empty layer: its boundaries are where a flight may end up by rounding.
    "layered": {"layered": {"breakpoints": [0.2, 0.3, 0.5], "values": [1, 6, 0, 2], "size": SIZE}},
    "nearest": {"cloud": CLOUD | {"interpolation": "nearest"}},
    "trilinear": {"cloud": CLOUD},
}

# The grid's cells end neither where voxels nor where layers do.
MAJORANTS = {"global": "global", "grid": {"grid": {"resolution": [5, 3, 4]}}}

CHORDS = {"chords": {"count": 256}}
