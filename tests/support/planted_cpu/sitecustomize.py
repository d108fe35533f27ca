"""Plants the fault of PoCL's wheel on a CPU that it does not know, in each Python that finds this.

Its device then calls the CPU `generic`, as it does by itself on CPUs that came after its compiler.
PLANTED_CPU=NAME plants another name: one that cannot be mended.
"""

import ctypes
import importlib.util
import os
import sys


class Plant:
    """Finds freepath.device.cpu_name as ever, and plants before it can mend."""

    def find_spec(self, name, path=None, target=None):
        if name != "freepath.device.cpu_name":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        execute = spec.loader.exec_module

        def exec_module(module):
            execute(module)
            genuine = module.mend

            def mend(version, address, *arguments):
                if version == module.VERSION:
                    plant(address + module.OFFSET)
                return genuine(version, address, *arguments)

            module.mend = mend

        spec.loader.exec_module = exec_module
        return spec


def plant(address):
    """Let the pointer at an address point to the planted name."""
    libc = ctypes.CDLL(None)
    libc.strdup.restype = ctypes.c_void_p
    name = os.environ.get("PLANTED_CPU", "generic")
    if name == "crash":
        os.abort()
    ctypes.c_void_p.from_address(address).value = libc.strdup(name.encode())


sys.meta_path.insert(0, Plant())
