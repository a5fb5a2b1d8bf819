"""The map of the house in CONTRIBUTING.md is that of the sources."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCES = ROOT / "crates" / "pdmp-core" / "src"


def rooms() -> list[str]:
    """Return the modules of the core that the map names, from the ground up and left to right."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| [1-5] \| (.*?) \|", text, re.MULTILINE)
    return [room for row in rows for room in re.findall(r"`(\w+)/?`", row)]


def imports(room: str) -> set[str]:
    """Return the other modules that a module names, its tests aside."""
    files = [SOURCES / f"{room}.rs", *(SOURCES / room).rglob("*.rs")]
    found = set()
    for file in files:
        if file.exists() and file.name != "tests.rs":
            code = file.read_text(encoding="utf-8").partition("mod tests {")[0]
            found.update(re.findall(r"\bcrate::([a-z_]+)\b", re.sub(r"//.*", "", code)))
    return found - {room}


def test_map_names_every_module_once() -> None:
    """No module is missing from the map, and none is on it that is gone."""
    modules = {path.stem for path in SOURCES.iterdir()} - {"lib"}
    assert sorted(rooms()) == sorted(modules)


def test_modules_import_from_below() -> None:
    """A module imports none that stands above it, or to its right on the same floor."""
    order = rooms()
    wrong = {
        (room, other)
        for k, room in enumerate(order)
        for other in imports(room)
        if other in order[k + 1 :]
    }
    assert not wrong
