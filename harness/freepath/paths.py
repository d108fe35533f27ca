"""Where kernels and configs are: in the package, or beside harness/ in the checkout it is in."""

from pathlib import Path

PACKAGE = Path(__file__).parent
HOME = PACKAGE if (PACKAGE / "kernels").is_dir() else PACKAGE.parents[1]
KERNELS, CONFIGS = HOME / "kernels", HOME / "configs"
