"""Prints the agreement with klimits and toppra."""

import platform
from importlib.metadata import version

import pdmp
from judges import durations, states

packages = ", ".join(f"{name} {version(name)}" for name in ("klimits", "toppra", "numpy"))
print(f"pdmp {pdmp.__version__}, {packages}, Python {platform.python_version()}")
states.report()
durations.report()
