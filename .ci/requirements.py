"""Print what an extra of the package requires, one requirement a line, nested extras resolved."""

import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

PROJECT = Path(__file__).parents[1] / "pyproject.toml"
EXTRAS = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]["optional-dependencies"]


def requirements(extra: str) -> Iterator[str]:
    """Give the requirements of an extra."""
    for line in EXTRAS[extra]:
        if nested := re.fullmatch(r"pdmp\[(.*)\]", line):
            for other in nested[1].split(","):
                yield from requirements(other.strip())
        else:
            yield line


if __name__ == "__main__":
    print("\n".join(dict.fromkeys(requirements(sys.argv[1]))))
