"""Checks the English of comments, documentation and messages against the house style.

Summaries of documentation open with a verb in the third person or a noun phrase, not with a clause
("What a map predicts"); words of a private idiom are not used. CONTRIBUTING.md has the rules.
"""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OPENINGS = re.compile(r"(?:What|How|Where|Whether|When|Which|All|The same)\b")
WORDS = re.compile(
    r"\b(?:foresee\w*|foresaw|foreseen|told|tells?|telling|owes?|hurry|hurries|at hand|whatever"
    r"|left over|by itself|so many|as many|for want of|may be had|asks? for|knows?|anew)\b",
    re.IGNORECASE,
)
# Places where a word is right; the list stays empty.
ALLOWED: frozenset[tuple[str, int]] = frozenset()
NAMES = {"Makefile", "run"}
SUFFIXES = {".rs", ".py", ".pyi", ".md", ".h", ".hpp", ".c", ".cpp", ".toml"}


def lines(path: Path) -> Iterator[tuple[int, str, bool]]:
    """Yields number and text of each line of prose, and whether it opens documentation."""
    inside = fenced = False
    previous = ""
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        text = line.strip()
        if path.suffix == ".md":
            fenced ^= text.startswith("```")
            if not fenced:
                yield number, re.sub(r"`[^`]*`|\]\([^)]*\)", "", text), False
        elif path.suffix in (".py", ".pyi"):
            opens = '"""' in text and not inside
            if inside or opens or text.startswith("#") or re.search(r'"[^"]* [^"]* ', text):
                yield number, re.sub(r"``?[^`]*``?", "", text.lstrip('rf"# ')), opens
            if text.count('"""') == 1:
                inside = not inside
        elif path.name in NAMES:
            yield number, re.sub(r"`[^`]*`", "", text.lstrip("# ")), False
        else:
            comment = re.search(r"(?<!:)//[/!]?(.*)", text) or re.match(r"/?\*+(.*)", text)
            opens = bool(re.match(r"//[/!]", text)) and not re.match(r"//[/!]", previous)
            if comment:
                yield number, re.sub(r"`[^`]*`", "", comment[1]).strip(), opens
            elif re.search(r'"[^"]* [^"]* ', text):
                yield number, text, False
        previous = text


def main() -> int:
    """Prints each violation; returns 1 if there is any, else 0."""
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    found = 0
    for name in listed.stdout.split("\0"):
        path = ROOT / name
        checked = path.suffix in SUFFIXES or path.name in NAMES
        if not checked or path == Path(__file__) or not path.exists():
            continue
        for number, text, opens in lines(path):
            wrong = WORDS.search(text) or (opens and OPENINGS.match(text))
            if wrong and (name, number) not in ALLOWED:
                found += 1
                print(f"{name}:{number}: {wrong[0]!r}: {text[:100]}")
    print(f"{found} places do not follow the house style of CONTRIBUTING.md" if found else "ok")
    return int(found > 0)


if __name__ == "__main__":
    sys.exit(main())
