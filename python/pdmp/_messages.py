"""Texts of errors and warnings without control characters, which files may hold."""

import sys
import warnings
from types import FrameType
from unicodedata import category

HIDDEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Categories of control characters, reversed directions, lone surrogates and line breaks."""


def printable(text: object, *, keep: str = "") -> str:
    """Returns a text with its control characters escaped, but for those to keep."""
    text = str(text)
    if text.isprintable():
        return text
    return "".join(c if c in keep or category(c) not in HIDDEN else ascii(c)[1:-1] for c in text)


def value_error(message: str) -> ValueError:
    """Returns an error whose text, which may quote a file or a name, has no control characters."""
    return ValueError(printable(message))


def warn(message: str) -> None:
    """Issues a `UserWarning` at the caller of this package, without control characters."""
    frame: FrameType | None = sys._getframe(1)
    level = 2
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "pdmp":
        frame, level = frame.f_back, level + 1
    warnings.warn(printable(message), UserWarning, stacklevel=level)
