"""Folders of recordings below the folder in an environment variable."""

import os
from pathlib import Path

from pdmp._messages import value_error
from pdmp.datasets._registry import REGISTRY

VARIABLE = "PDMP_DATA"
"""Environment variable with the path of the folder of all sets."""


def folder(name: str) -> Path:
    """Returns the folder of a set of recordings, for `pdmp.io.read_folder`.

    Parameters
    ----------
    name : str
        Name of a set in `REGISTRY`.

    Raises
    ------
    ValueError
        A name that is not in the registry.
    FileNotFoundError
        The environment variable `PDMP_DATA` is not set, or its folder lacks the set.
    """
    if name not in REGISTRY:
        raise value_error(f"name: no '{name}' among {', '.join(REGISTRY)}")
    root = os.environ.get(VARIABLE)
    path = Path(root or "", name)
    if root and path.is_dir():
        return path
    reason = f"{path} is not a folder" if root else f"{VARIABLE} is not set"
    recordings = REGISTRY[name]
    raise FileNotFoundError(
        f"{name}: {reason}: set the environment variable {VARIABLE} to a folder with {name}/; the "
        f"recordings are at {recordings.url} ({recordings.licence})"
    )
