"""`python -m freepath` is `freepath`."""

import sys

from freepath.cli import main

sys.exit(main())
