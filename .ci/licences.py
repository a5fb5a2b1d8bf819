"""Checks licences and sources of the linked crates, and collects their licence texts.

`licences.py` checks that every crate in the extension or the C library comes from crates.io, that
its licence is allowed, and that LICENSE-THIRD-PARTY, which the wheel includes, is up to date;
`licences.py --write` writes that file. Cargo runs offline.
"""

import json
import re
import subprocess
import sys
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
OUTPUT = ROOT / "LICENSE-THIRD-PARTY"
PACKAGES = ("pdmp-py", "pdmp-capi")
REGISTRY = "registry+https://github.com/rust-lang/crates.io-index"
# Permissive licences that require only a copy of their text, in order of preference.
ALLOWED = {
    "MIT": "MIT",
    "Apache-2.0": "APACHE",
    "Zlib": "ZLIB",
    "BSD-2-Clause": "BSD",
    "BSD-3-Clause": "BSD",
    "ISC": "ISC",
    "Unicode-3.0": "UNICODE",
}
HEAD = """Licences of the third-party software in the compiled parts of pdmp
==================================================================

The extension module and the library for C contain the Rust standard library (The Rust Project
Developers, MIT OR Apache-2.0) and the crates below, as linked on Linux for x86-64. The source of
each, unchanged, is at https://crates.io/crates/NAME/VERSION. Each text follows the crates that it
applies to. Made by .ci/licences.py --write.
"""


def cargo(*arguments: str) -> str:
    """Returns the output of cargo, which does not change Cargo.lock."""
    command = ["cargo", *arguments, "--locked"]
    return subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout


def linked() -> list[dict[str, Any]]:
    """Returns the metadata of cargo of all linked crates of others."""
    target = "x86_64-unknown-linux-gnu"
    packages = [argument for package in PACKAGES for argument in ("-p", package)]
    options = ["-e", "normal,no-proc-macro", "--prefix", "none", "-f", "{p}", "--target", target]
    tree = cargo("tree", *packages, *options).splitlines()
    names = {tuple(line.split()[:2]) for line in tree if line}
    described = json.loads(cargo("metadata", "--format-version", "1", "--filter-platform", target))
    members = set(described["workspace_members"])
    found = [
        crate
        for crate in described["packages"]
        if (crate["name"], f"v{crate['version']}") in names and crate["id"] not in members
    ]
    return sorted(found, key=lambda crate: (crate["name"], crate["version"]))


def chosen(crate: dict[str, Any]) -> list[str] | None:
    """Returns the selected licences of a crate, or None if one is not allowed."""
    found = []
    for part in re.split(r"\s+AND\s+", crate["license"] or ""):
        offered = re.split(r"\s+OR\s+|/", part.strip("() "))
        allowed = [licence for licence in ALLOWED if licence in offered]
        if not allowed:
            return None
        found.append(allowed[0])
    return found


def texts(crate: dict[str, Any], licence: str) -> list[str]:
    """Returns the texts of a licence, and notices, in the source of a crate."""
    folder = Path(crate["manifest_path"]).parent
    files = [
        path
        for path in sorted(folder.iterdir())
        if path.is_file() and re.match("(?i)(licen[sc]e|copying|notice|copyright)", path.name)
    ]
    named = [path for path in files if ALLOWED[licence] in path.name.upper()]
    others = [tag for tag in {*ALLOWED.values(), "UNLICENSE"} if tag != ALLOWED[licence]]
    general = [path for path in files if not any(tag in path.name.upper() for tag in others)]
    notices = [path for path in files if path.name.upper().startswith(("NOTICE", "COPYRIGHT"))]
    found = [path.read_text(encoding="utf-8").strip() for path in {*(named or general), *notices}]
    return sorted(found) or [standard(crate, licence)]


def standard(crate: dict[str, Any], licence: str) -> str:
    """Returns the standard text of a licence for a crate without a copy."""
    if licence == "Apache-2.0":
        return (ROOT / "LICENSE-APACHE").read_text(encoding="utf-8").strip()
    if licence == "MIT":
        holders = ", ".join(crate["authors"]) or f"the authors of {crate['name']}"
        text = (ROOT / "LICENSE-MIT").read_text(encoding="utf-8").strip()
        return re.sub("Copyright.*", f"Copyright (c) {holders}", text, count=1)
    raise SystemExit(f"{crate['name']} {crate['version']}: no text of its licence {licence}")


def collected(crates: list[dict[str, Any]]) -> str:
    """Returns all texts, each once, below the crates that it applies to."""
    groups: dict[str, list[str]] = defaultdict(list)
    whole: dict[str, str] = {}
    for crate in crates:
        for licence in chosen(crate) or []:
            for text in texts(crate, licence):
                key = " ".join(text.split())
                whole.setdefault(key, text)
                label = f"{crate['name']} {crate['version']} ({licence})"
                groups[key] += [label] if label not in groups[key] else []
    parts = [
        "\n".join([*labels, "", *(line.rstrip() for line in whole[key].splitlines())])
        for key, labels in groups.items()
    ]
    return f"\n\n{'-' * 78}\n".join([HEAD.strip(), *parts]) + "\n"


def main() -> int:
    """Checks the licences or writes their texts; returns 1 if a check fails."""
    crates = linked()
    wrong = [
        f"{crate['name']} {crate['version']}: {problem}"
        for crate in crates
        for problem in (
            crate["source"] != REGISTRY and f"comes from {crate['source']}, not from crates.io",
            chosen(crate) is None and f"its licence {crate['license']} is not allowed",
        )
        if problem
    ]
    if not wrong and "--write" in sys.argv[1:]:
        OUTPUT.write_text(collected(crates), encoding="utf-8")
    elif not wrong and (not OUTPUT.exists() or OUTPUT.read_text("utf-8") != collected(crates)):
        wrong = [f"{OUTPUT.name} is out of date: run `make licences`"]
    versions = Counter(crate["name"] for crate in crates)
    twice = ", ".join(name for name, count in versions.items() if count > 1) or "none"
    print(*wrong, f"{len(crates)} crates linked; in two versions: {twice}", sep="\n")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
