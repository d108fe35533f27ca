import os
from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    """Keep tests out of the user's cache, and each test out of the others'."""
    monkeypatch.setenv("FREEPATH_CACHE", str(tmp_path / "cache"))


@pytest.fixture(scope="session")
def real_volumes():
    """Return the folder of the real clouds, which are no part of the project."""
    beside = Path(__file__).parents[3] / "shared" / "volumes"
    folders = [*filter(None, os.environ.get("FREEPATH_VOLUMES", "").split(os.pathsep)), beside]
    for folder in map(Path, folders):
        if (folder / "cloud_wdas16.npy").exists():
            return folder
    pytest.skip("no cloud_wdas16.npy in $FREEPATH_VOLUMES or ../shared/volumes")
