import os

import pytest
from freepath import catalog, device
from freepath.errors import DeviceError
from support.rig import Rig


@pytest.fixture(scope="session")
def device_under_test():
    """$FREEPATH_TEST_DEVICE, else the PoCL that comes with pip, else the first device."""
    chosen = os.environ.get("FREEPATH_TEST_DEVICE")
    if chosen:
        return device.open_devices([chosen])[0]
    try:
        return device.open_devices(["3.0"])[0]
    except DeviceError:
        return device.open_devices([])[0]


@pytest.fixture(scope="session")
def rig(device_under_test, tmp_path_factory):
    return Rig(device_under_test, catalog.load(), tmp_path_factory.mktemp("rig"))
