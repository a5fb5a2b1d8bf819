"""Output to the terminal."""

import re
import sys
import warnings
from argparse import ArgumentParser
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TextIO

from pdmp._messages import printable

# Python arguments whose command-line options have another name.
_RENAMED = {"contexts": "context", "demos": "demo", "n_styles": "styles"}


_HINT = re.compile(r" \((\w+)=\)")

aliases: dict[str, str] = {}
"""Names in messages of temporary files."""


def option_names(parser: ArgumentParser) -> dict[str, str]:
    """Returns the options of a command by the names of the Python arguments that they set."""
    options = {
        action.dest: option
        for action in parser._actions
        for option in action.option_strings
        if option.startswith("--") and action.dest not in ("help", "output")
    }
    renamed = {name: options[dest] for name, dest in _RENAMED.items() if dest in options}
    return options | renamed


def say(text: object, *, file: TextIO | None = None) -> None:
    """Writes a line, with control characters escaped."""
    print(printable(text), file=file)


def report(text: str) -> None:
    """Writes several lines, with control characters escaped."""
    print(printable(text, keep="\n"))


def one_line(message: object, options: Mapping[str, str]) -> str:
    """Returns a message in one line, with command-line options for arguments of Python.

    A message names an argument at its beginning or behind a file or demonstration, as in "demo 0:
    dt = 0: must be positive", or recommends one, as in "pass dt=" or "set goal".
    """
    text = printable(" ".join(str(message).split()))
    for path, name in aliases.items():
        text = text.replace(path, name)
    if not options:
        return text
    name = "|".join(sorted(options, key=len, reverse=True))
    argument = re.compile(
        rf"\b({name})=(?!=)"
        rf"|(?<=: pass )({name})\b|(?<=; set )({name})\b"
        rf"|(?:^|(?<=: )|(?<=^n_styles and ))({name})"
        r"(?= = | and | has |: | does not | is missing| needs )"
        rf"|^({name})(?=\[\d)"
    )
    # Quoted parts are values of the user.
    parts = re.split(r"""("[^"]*"|'[^']*')""", text)
    parts[::2] = [_HINT.sub(lambda hint: _known(hint, options), part) for part in parts[::2]]
    parts[::2] = [
        argument.sub(lambda match: options["".join(filter(None, match.groups()))], part)
        for part in parts[::2]
    ]
    return "".join(parts)


def _known(hint: re.Match[str], options: Mapping[str, str]) -> str:
    """Returns a hint at an argument; one that no option sets is for Python alone."""
    return hint[0] if hint[1] in options else f" ({hint[1]}= in Python)"


@contextmanager
def console() -> Iterator[None]:
    """Writes ? for characters that the console cannot encode."""
    changed = []
    for stream in (sys.stdout, sys.stderr):
        errors, reconfigure = getattr(stream, "errors", None), getattr(stream, "reconfigure", None)
        if errors in ("strict", "surrogateescape") and reconfigure is not None:
            reconfigure(errors="replace")
            changed.append((reconfigure, errors))
    try:
        yield
    finally:
        for reconfigure, errors in changed:
            reconfigure(errors=errors)


@contextmanager
def short_warnings(options: Mapping[str, str]) -> Iterator[None]:
    """Writes each warning in one line."""

    def show(message: Warning | str, *_: object, **__: object) -> None:
        print(f"pdmp: warning: {one_line(message, options)}", file=sys.stderr)

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield
