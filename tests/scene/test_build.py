from types import SimpleNamespace

import numpy as np
import pytest

from freepath.errors import VolumeError
from freepath.scene import build_medium
from freepath.scene.media.cloud import cloud
from freepath.scene.volumes.reading import Volume
from scene.helpers import volume_model

SIZE = (1.0, 2.0, 4.0)

MODELS = {
    "homogeneous": {"sigma_t": 2.0},
    "linear": {"bottom": 1.0, "top": 3.0},
    "exponential": {"sigma_t": 2.0, "scale_height": 2.0},
    "gaussian": {"sigma_t": 2.0, "width": 0.5, "center": (0.5, 0.5, 1.0)},
    "cosine": {"sigma_t": 2.0, "amplitude": 0.5, "periods": 2.0, "phase": 0.0},
    "layered": {"breakpoints": (2.0,), "values": (1.0, 3.0)},
}

AT_ONE = {
    "homogeneous": 2.0,
    "linear": 1.5,
    "exponential": 2.0 * np.exp(-0.5),
    "gaussian": 2.0,
    "cosine": 1.0,
    "layered": 1.0,
}


@pytest.mark.parametrize("kind", MODELS)
def test_closed_forms(kind):
    medium = build_medium(SimpleNamespace(kind=kind, channels=None, size=SIZE, **MODELS[kind]))
    assert medium.kernel == kind
    assert medium.extent.tolist() == list(SIZE)
    assert medium.to_medium.tolist() == np.eye(3, 4).tolist()
    assert medium.sigma_t(np.array([[0.5, 0.5, 1.0]]))[0] == pytest.approx(AT_ONE[kind])


@pytest.mark.parametrize("interpolation", ["trilinear", "nearest"])
def test_cloud(interpolation):
    model = SimpleNamespace(
        channels=None,
        kind="cloud",
        resolution=8,
        seed=3,
        sigma_t=50.0,
        floor=0.0,
        interpolation=interpolation,
        size=SIZE,
    )
    medium = build_medium(model)
    assert medium.kernel == f"grid_{interpolation}"
    assert medium.extent.tolist() == [8.0, 8.0, 8.0]
    assert medium.world_box()[-1].tolist() == list(SIZE)
    assert medium.data.max() == 50.0
    assert medium.data.tolist() == (cloud(8, 3) * np.float32(50.0)).ravel().tolist()


def test_volume_size_and_scale(tmp_path):
    np.save(tmp_path / "v.npy", np.arange(24).reshape(2, 3, 4))
    medium = build_medium(
        volume_model("v.npy", sigma_t=0.5, voxel_size=(1.0, 2.0, 3.0)), [tmp_path]
    )
    assert medium.world_box()[-1].tolist() == [4.0, 6.0, 6.0]
    assert medium.data.tolist() == (np.arange(24) / 2).tolist()
    single = build_medium(volume_model("v.npy", voxel_size=2.0), [tmp_path])
    assert single.world_box()[-1].tolist() == [8.0, 6.0, 4.0]


def test_the_floor_of_a_cloud_is_its_homogeneous_part():
    model = SimpleNamespace(
        channels=None,
        kind="cloud",
        resolution=8,
        seed=3,
        sigma_t=50.0,
        floor=0.4,
        interpolation="nearest",
        size=SIZE,
    )
    expected = 50.0 * (0.4 + 0.6 * cloud(8, 3).astype(np.float64))
    np.testing.assert_allclose(build_medium(model).voxels, expected, rtol=1e-6)


def test_a_scaled_cloud_that_overflows_is_refused():
    model = SimpleNamespace(
        channels=None,
        kind="cloud",
        resolution=4,
        seed=1,
        sigma_t=1e39,
        floor=0.0,
        interpolation="nearest",
        size=SIZE,
    )
    with pytest.raises(VolumeError, match="cloud 4: densities that cannot be used: .* too large"):
        build_medium(model)


def test_a_transform_that_flattens_is_refused(tmp_path, monkeypatch):
    flat = np.diag([1.0, 0.0, 1.0, 0.0])[:3]
    monkeypatch.setattr(
        "freepath.scene.volumes.openvdb.read_openvdb",
        lambda path, _: Volume(path, np.ones((2, 2, 2)), flat),
    )
    (tmp_path / "v.vdb").write_text("never read")
    with pytest.raises(VolumeError, match="its transform cannot be inverted"):
        build_medium(volume_model(tmp_path / "v.vdb"))
