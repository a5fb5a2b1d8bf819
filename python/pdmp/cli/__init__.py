"""The command `pdmp`."""

from pdmp.cli.main import main

__all__ = ["main"]
