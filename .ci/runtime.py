"""Checks the dependencies of a build without learning."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Largest number of dependencies, build-time macros included; one more needs a reason.
MAX_CRATES = 47
TREE = ("cargo", "tree", "--locked", "--edges", "normal", "--prefix", "none")


def main() -> int:
    """Reports dependencies of learning, or too many dependencies, of the core and the C ABI."""
    for package in (["pdmp-core", "--no-default-features"], ["pdmp-capi"]):
        tree = subprocess.run(
            [*TREE, "--package", *package], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout
        crates = {line.split()[0] for line in tree.splitlines() if line}
        if {"faer", "clarabel"} & set(crates) or len(crates) > MAX_CRATES + (
            package[0] == "pdmp-capi"
        ):
            print(f"{package[0]} without learning needs {len(crates)} crates:", *sorted(crates))
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
