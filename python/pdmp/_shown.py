"""Texts from files, fit for a terminal."""

from unicodedata import category

HIDDEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Categories of control characters, reversed directions, lone surrogates and line breaks."""


def printable(text: object, *, keep: str = "") -> str:
    """Return a text with its control characters escaped, but for those to keep."""
    text = str(text)
    if text.isprintable():
        return text
    return "".join(c if c in keep or category(c) not in HIDDEN else ascii(c)[1:-1] for c in text)


def refusal(message: str) -> ValueError:
    """Return an error whose text, which may quote a file or a name, has no control characters."""
    return ValueError(printable(message))
