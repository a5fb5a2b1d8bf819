"""Published joint limits of robots, with their sources."""

import tomllib
from pathlib import Path
from typing import Any

from pdmp.robots._robot import Robot

_TABLE = Path(__file__).with_name("registry.toml").read_text(encoding="utf-8")


def _robot(name: str, entry: dict[str, Any]) -> Robot:
    fields: dict[str, Any] = {
        key: tuple(value) if isinstance(value, list) else value for key, value in entry.items()
    }
    return Robot(name=name, **fields)


REGISTRY: dict[str, Robot] = {
    name: _robot(name, entry) for name, entry in tomllib.loads(_TABLE).items()
}
"""Published joint limits of robots, by name."""
