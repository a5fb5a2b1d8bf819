"""Checks the crates that a build without learning depends on."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Crates that a control loop pulls in, build-time macros included; one more needs a reason.
MAX_CRATES = 47
TREE = ("cargo", "tree", "--locked", "--edges", "normal", "--prefix", "none")


def main() -> int:
    """Report a dependency that belongs to learning, or too many, for the core and the C ABI."""
    for package in (["pdmp-core", "--no-default-features"], ["pdmp-capi"]):
        tree = subprocess.run(
            [*TREE, "--package", *package], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout
        crates = {line.split()[0] for line in tree.splitlines() if line}
        if "faer" in crates or len(crates) > MAX_CRATES + (package[0] == "pdmp-capi"):
            print(f"{package[0]} without learning needs {len(crates)} crates:", *sorted(crates))
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
