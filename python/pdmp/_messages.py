"""Errors and warnings whose texts, which quote files, have no control characters."""

import sys
import warnings
from types import FrameType
from unicodedata import category

CONTROL = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Unicode categories of control and format characters, surrogates and line breaks."""


def printable(text: object, *, keep: str = "") -> str:
    """Returns a text with its control characters, other than those in `keep`, escaped."""
    text = str(text)
    if text.isprintable():
        return text
    return "".join(c if c in keep or category(c) not in CONTROL else ascii(c)[1:-1] for c in text)


def value_error(message: str) -> ValueError:
    """Returns an error without control characters in its text."""
    return ValueError(printable(message))


def warn(message: str) -> None:
    """Issues a `UserWarning` without control characters, located at the caller of this package."""
    frame: FrameType | None = sys._getframe(1)
    level = 2
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "pdmp":
        frame, level = frame.f_back, level + 1
    warnings.warn(printable(message), UserWarning, stacklevel=level)
