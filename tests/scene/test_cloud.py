import hashlib

import numpy as np
import pytest

from freepath.scene.media.cloud import cloud

PINNED = {
    (32, 1): "60917ea97d43a9ab9feb9dbe00f7660e",
    (32, 7): "6ff997211c3b53862e24e121fc3a36a9",
    (57, 3): "fdd5e6b91a31be89b7a2c277d5bb5edc",
}


@pytest.mark.parametrize(("resolution", "seed"), PINNED)
def test_clouds_never_change(resolution, seed):
    found = hashlib.sha256(cloud(resolution, seed).tobytes()).hexdigest()
    assert found.startswith(PINNED[resolution, seed])


@pytest.mark.parametrize("seed", [1, 2, 3, 2**64 - 1])
def test_most_voxels_are_empty_and_the_largest_is_one(seed):
    density = cloud(48, seed)
    assert density.shape == (48, 48, 48)
    assert density.dtype == np.float32
    assert density.max() == 1.0
    assert density.min() == 0.0
    assert 0.6 < np.mean(density == 0.0) < 0.8
    assert 0.08 < density.mean() < 0.2


@pytest.mark.parametrize("resolution", [2, 3, 5])
def test_the_smallest_clouds_are_not_empty(resolution):
    assert cloud(resolution, 1).max() == 1.0


def test_the_resolution_does_not_change_the_shape():
    # an odd multiple has the coarse voxels' centres among its own
    coarse, fine = cloud(24, 5), cloud(72, 5)[1::3, 1::3, 1::3]
    np.testing.assert_allclose(coarse / coarse.mean(), fine / fine.mean(), atol=2e-5)


def test_slabs_do_not_show(monkeypatch, tmp_path):
    whole = cloud(20, 1)
    monkeypatch.setattr("freepath.scene.media.cloud.SLAB", 1)
    monkeypatch.setenv("FREEPATH_CACHE", str(tmp_path / "other"))
    assert np.array_equal(cloud(20, 1), whole)


def test_a_cumulus_has_a_flat_base_and_stays_off_the_walls():
    density = cloud(48, 1)
    filled = (density > 0.0).mean(axis=(1, 2))
    bottom = np.flatnonzero(filled)[0]
    top = np.flatnonzero(filled)[-1]
    assert filled[bottom + 4] > 1.5 * filled[top - 4]
    walls = [density[0], density[-1], density[:, 0], density[:, -1]]
    assert not any(wall.any() for wall in walls)
