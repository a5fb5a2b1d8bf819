"""Output to the terminal."""

import re
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

from pdmp._messages import printable

# Arguments of Python that a message asks for, and those that it reports, at its beginning or behind
# a file or demonstration.
_ARGUMENT = re.compile(
    r"\b(contexts|dt|max_gap|period|time)="
    r"|(?:^|(?<=: ))(dt|max_gap|period|smoothing)(?= = | does not )"
    r"|(?:^|(?<=^n_styles and ))(amplitude|anchor|context|demos|duration|goal"
    r"|goal_velocity|n_styles|singular_value_share|start|style|tau|velocity)"
    r"(?= = | and |\[| has |: | does not )"
)
_RENAMED = {"contexts": "context", "demos": "demo", "n_styles": "styles"}


def say(text: object, *, file: TextIO | None = None) -> None:
    """Writes a line, with control characters escaped."""
    print(printable(text), file=file)


def report(text: str) -> None:
    """Writes several lines, with control characters escaped."""
    print(printable(text, keep="\n"))


def one_line(message: object) -> str:
    """Returns a message in one line, with command-line options for arguments of Python."""
    return _ARGUMENT.sub(_option, printable(" ".join(str(message).split())))


def _option(match: re.Match[str]) -> str:
    name = "".join(filter(None, match.groups()))
    return "--" + _RENAMED.get(name, name).replace("_", "-")


@contextmanager
def console() -> Iterator[None]:
    """Writes warnings in one line, and ? for characters that the console cannot encode."""
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
    print(f"pdmp: warning: {one_line(message)}", file=sys.stderr)
