"""Errors and warnings whose texts, which quote files, have no control characters."""

import sys
import warnings
from types import FrameType
from typing import Any
from unicodedata import category

CONTROL = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Unicode categories of control and format characters, surrogates and line breaks."""
MAX_QUOTED = 60  # characters of a value in a message


def printable(text: object, *, keep: str = "") -> str:
    """Returns a text with its control characters, other than those in `keep`, escaped."""
    text = str(text)
    if text.isprintable():
        return text
    return "".join(c if c in keep or category(c) not in CONTROL else ascii(c)[1:-1] for c in text)


def value_error(message: str) -> ValueError:
    """Returns an error without control characters in its text."""
    return ValueError(printable(message))


def counted(number: int, name: str) -> str:
    """Returns a number of things with their name, in the singular or plural."""
    return f"{number} {name}{'s' * (number != 1)}"


def quoted(value: object) -> str:
    """Returns a value as text for a message, in one line and shortened."""
    text = printable(" ".join(repr(value).split()))
    return text if len(text) <= MAX_QUOTED else text[: MAX_QUOTED - 3] + "..."


def check_type(name: str, value: object, kind: type | tuple[type, ...], expected: str) -> None:
    """Raises TypeError for an argument of another type."""
    if not isinstance(value, kind):
        raise TypeError(f"{name} = {quoted(value)}: expected {expected}")


def check_number(name: str, value: Any) -> None:
    """Raises ValueError for an argument that is not one number."""
    try:
        if not isinstance(value, (str, bytes)):
            float(value)
            return
    except (TypeError, ValueError, OverflowError):
        pass
    raise ValueError(f"{name} = {quoted(value)}: expected one number")


def check_function(name: str, value: object) -> None:
    """Raises TypeError for an argument that cannot be called."""
    if not callable(value):
        raise TypeError(f"{name} = {quoted(value)}: expected a function")


def warn(message: str) -> None:
    """Issues a `UserWarning` without control characters, located at the caller of this package."""
    frame: FrameType | None = sys._getframe(1)
    level = 2
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "pdmp":
        frame, level = frame.f_back, level + 1
    warnings.warn(printable(message), UserWarning, stacklevel=level)
