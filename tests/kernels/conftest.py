import pytest
from freepath import catalog, device
from freepath.errors import DeviceError
from support.rig import Rig


@pytest.fixture(scope="session")
def device_under_test():
    """The PoCL that comes with pip where it is installed, else the first device."""
    try:
        return device.open_devices(["3.0"])[0]
    except DeviceError:
        return device.open_devices([])[0]


@pytest.fixture(scope="session")
def rig(device_under_test, tmp_path_factory):
    return Rig(device_under_test, catalog.load(), tmp_path_factory.mktemp("rig"))
