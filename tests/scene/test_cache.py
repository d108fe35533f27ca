import os

import numpy as np
import pytest

from freepath.scene.cache import cache_dir, cached


class Computation:
    def __init__(self):
        self.calls = 0

    def __call__(self):
        self.calls += 1
        return np.arange(6.0).reshape(2, 3)


@pytest.fixture
def compute():
    return Computation()


def path():
    return cache_dir() / "folder" / "name.npy"


def test_what_was_computed_is_kept(compute):
    first = cached("folder/name", compute)
    second = cached("folder/name", compute)
    assert compute.calls == 1
    assert second.tolist() == first.tolist()
    assert np.load(path()).tolist() == first.tolist()
    assert os.listdir(path().parent) == ["name.npy"]


def flip_a_bit(content):
    return content[:-40] + bytes([content[-40] ^ 1]) + content[-39:]


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: b"something else",
        lambda content: content[:-1],
        lambda content: content[:-32],  # a .npy that another program wrote
        lambda content: content[:100],
        flip_a_bit,
        lambda content: content.replace(b"(2, 3)", b"(3, 2)"),
    ],
)
def test_a_damaged_or_foreign_file_is_made_anew(compute, damage):
    good = cached("folder/name", compute)
    intact = path().read_bytes()
    path().write_bytes(damage(intact))
    assert cached("folder/name", compute).tolist() == good.tolist()
    assert compute.calls == 2
    assert path().read_bytes() == intact


def test_the_array_of_another_name_is_not_taken(compute):
    cached("folder/other", compute)
    (cache_dir() / "folder" / "other.npy").rename(path())
    cached("folder/name", compute)
    assert compute.calls == 2


def test_a_cache_that_cannot_be_written_is_done_without(compute, tmp_path, monkeypatch):
    in_the_way = tmp_path / "file"
    in_the_way.write_text("no folder")
    monkeypatch.setenv("FREEPATH_CACHE", str(in_the_way))
    for _ in range(2):
        assert cached("folder/name", compute).shape == (2, 3)
    assert compute.calls == 2


def test_without_the_variable_it_is_the_users_cache_folder(monkeypatch):
    import platformdirs

    monkeypatch.delenv("FREEPATH_CACHE")
    assert str(cache_dir()) == platformdirs.user_cache_dir("freepath")
