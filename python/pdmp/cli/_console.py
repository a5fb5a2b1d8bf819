"""What commands write to the terminal."""

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

from pdmp._messages import printable


def say(text: object, *, file: TextIO | None = None) -> None:
    """Writes a line, with control characters escaped."""
    print(printable(text), file=file)


def report(text: str) -> None:
    """Writes several lines, with control characters escaped."""
    print(printable(text, keep="\n"))


@contextmanager
def console() -> Iterator[None]:
    """Writes warnings in one line, and ? in place of characters that the console lacks."""
    with warnings.catch_warnings():
        warnings.showwarning = _warning
        changed = []
        for stream in (sys.stdout, sys.stderr):
            errors, reconfigure = (
                getattr(stream, "errors", None),
                getattr(stream, "reconfigure", None),
            )
            if errors in ("strict", "surrogateescape") and reconfigure is not None:
                reconfigure(errors="replace")
                changed.append((reconfigure, errors))
        try:
            yield
        finally:
            for reconfigure, errors in changed:
                reconfigure(errors=errors)


def _warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"pdmp: warning: {printable(' '.join(str(message).split()))}", file=sys.stderr)
