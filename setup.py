"""Puts kernels, configs and their schema into the wheel: they are not in the package's folder."""

import shutil
import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class BuildWhole(build_py):
    """The package, and what it needs beside it in a checkout."""

    def run(self):
        """Build it; an editable one finds kernels and configs where they are."""
        super().run()
        if self.editable_mode:
            return
        package = Path(self.build_lib, "freepath")
        for name in ("kernels", "configs"):
            shutil.rmtree(package / name, ignore_errors=True)  # of a build before
            shutil.copytree(name, package / name)
        sys.path.insert(0, self.build_lib)
        sys.dont_write_bytecode = True
        from freepath.compose import catalog  # noqa: PLC0415
        from freepath.config import schema  # noqa: PLC0415

        text = schema.text(catalog.load().parameter_models())
        (package / "configs" / "schema.json").write_text(text, "utf-8")


setup(cmdclass={"build_py": BuildWhole})
