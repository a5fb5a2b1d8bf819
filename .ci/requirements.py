"""Prints the requirements of a dependency group, one per line, with groups and extras resolved.

pip before version 25.1 does not read dependency groups, and looks for `pdmp[plot]` in an index.
"""

import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

PROJECT = tomllib.loads(Path(__file__).parents[1].joinpath("pyproject.toml").read_text("utf-8"))
EXTRAS = PROJECT["project"]["optional-dependencies"]
GROUPS = PROJECT["dependency-groups"]


def requirements(lines: list[str | dict[str, str]]) -> Iterator[str]:
    """Yields the requirements in the lines of a group or an extra."""
    for line in lines:
        if isinstance(line, dict):
            yield from requirements(GROUPS[line["include-group"]])
        elif own := re.fullmatch(r"pdmp\[(.*)\]", line):
            for extra in own[1].split(","):
                yield from requirements(EXTRAS[extra.strip()])
        else:
            yield line


if __name__ == "__main__":
    print("\n".join(dict.fromkeys(requirements(GROUPS[sys.argv[1]]))))
