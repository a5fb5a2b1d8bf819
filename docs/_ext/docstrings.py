"""Conversion of docstrings to reStructuredText.

The docstrings write names in single backticks and magnitudes as |v|, as Markdown does. Here a name
of the package becomes a link, any other text in backticks a literal, and bars are escaped.
"""

import re
from typing import Any

from sphinx.application import Sphinx

import pdmp

TICKS = re.compile(r"(?<![:`\w])`([^`\n]+)`(?![`_])")


def target(text: str, owner: str) -> str | None:
    """Returns the full name of a public object that a docstring mentions."""
    name = text.removeprefix("pdmp.").partition("(")[0]
    holder: Any
    found: Any
    home = owner.split(".")[1] if owner.count(".") else ""
    for path in (name, f"{home}.{name}"):
        holder, found = None, pdmp
        for part in path.split("."):
            public = part and not part.startswith("_")
            holder, found = found, getattr(found, part, None) if public else None
        if callable(found) or (found is not None and isinstance(holder, type)):
            return f"pdmp.{path}"
    return None


def convert(_: Sphinx, what: str, owner: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Rewrites the lines of a docstring in place, except literal blocks and examples."""

    def link(match: re.Match[str]) -> str:
        path = target(match[1], owner)
        return f":py:obj:`{match[1]} <{path}>`" if path else f"``{match[1]}``"

    literal: int | None = None  # indentation of the paragraph before a literal block
    for number, line in enumerate(lines):
        indent = len(line) - len(line.lstrip())
        if line.strip() and literal is not None and indent <= literal:
            literal = None
        if literal is not None or line.lstrip().startswith((">>>", "...", ".. ")):
            continue
        lines[number] = TICKS.sub(link, line).replace("|", r"\|")
        if line.rstrip().endswith("::"):
            literal = indent


def setup(app: Sphinx) -> dict[str, bool]:
    """Connects the conversion behind that of numpydoc."""
    app.connect("autodoc-process-docstring", convert, priority=900)
    return {"parallel_read_safe": True}
