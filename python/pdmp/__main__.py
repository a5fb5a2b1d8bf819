"""Runs the command as `python -m pdmp`."""

import sys

from pdmp.cli import main

sys.exit(main())
