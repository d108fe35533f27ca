"""A small catalog of made-up trackers, so that tests of configs do not depend on the kernels."""

import os
import shutil

import pytest

from freepath.compose import catalog

if "FREEPATH_TEST_DEVICE" in os.environ:
    os.environ["FREEPATH_DEVICE"] = os.environ["FREEPATH_TEST_DEVICE"]

SMALL_TRACKERS = {
    "exact": "estimands: [transmittance, free_path]\nneeds: [closed_form]",
    "cells": "estimands: [transmittance]\nneeds: [cells]",
    "delta": "estimands: [transmittance, free_path]\nneeds: [majorant]\nbounding: true",
    "march": (
        "estimands: [transmittance, free_path]\n"
        "unbiased: false\n"
        "parameters:\n"
        "  step: {unit: length, default: 0.01, above: 0, meaning: length of a step}\n"
        "  placement: {choices: [start, midpoint, jittered], default: midpoint}\n"
        "  order: {unit: count, default: 1, minimum: 1, maximum: 3}"
    ),
}


def tracker_text(front: str, title: str = "A tracker") -> str:
    """Return the text of a tracker's file with this front matter."""
    return f"/*---\ntitle: {title}\n{front}\n---*/\nvoid begin(void) {{}}\nvoid step(void) {{}}\n"


@pytest.fixture(scope="session")
def small_catalog(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trackers")
    for name, front in SMALL_TRACKERS.items():
        (folder / f"{name}.cl").write_text(tracker_text(front))
    return catalog.load([folder], builtin=False)


@pytest.fixture
def load_text(tmp_path, monkeypatch, small_catalog):
    """Load a config from its text, as the file x.yaml of the working directory."""
    from freepath import config

    monkeypatch.chdir(tmp_path)

    def load(text, overrides=()):
        (tmp_path / "x.yaml").write_text(text)
        return config.load("x.yaml", small_catalog.parameter_models(), overrides)

    return load


@pytest.fixture(scope="session")
def trials():
    """The file of what drivers' trials showed, for caches that begin empty."""
    from freepath.device import trial

    trial.of_installed()
    return trial.cache_file()


@pytest.fixture(scope="session")
def device(trials):
    """The device that no -d means: $FREEPATH_DEVICE, or the first that works."""
    from freepath.device.selection import one_device

    return one_device([])


@pytest.fixture
def selector(device):
    """What -d takes for that device."""
    info = device.info
    return f"{info.platform} / {info.name} / {info.driver_version}"


@pytest.fixture
def work(tmp_path, monkeypatch, trials):
    """An empty working directory, with a cache of its own that knows the drivers."""
    monkeypatch.setenv("FREEPATH_CACHE", str(tmp_path / "cache"))
    (tmp_path / "cache").mkdir()
    shutil.copy(trials, tmp_path / "cache")
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture(scope="session")
def rig(device, tmp_path_factory):
    from freepath.checks.rig import Rig

    return Rig(device, catalog.load(), tmp_path_factory.mktemp("rig"))
