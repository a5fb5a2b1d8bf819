"""Sources, licences and contents of the recordings that reports and tests use."""

import tomllib
from pathlib import Path

from pdmp.datasets._dataset import Dataset

_TABLE = Path(__file__).with_name("registry.toml").read_text(encoding="utf-8")

REGISTRY: dict[str, Dataset] = {
    name: Dataset(name, **entry) for name, entry in tomllib.loads(_TABLE).items()
}
"""Descriptions of all sets of recordings, by their name."""
