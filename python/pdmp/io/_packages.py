"""Packages that read binary formats, imported at their first use, and their errors."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from pdmp._messages import printable, value_error

MAX_REASON = 200
"""Largest number of characters of another package's error in an error."""


def load(module: str, extra: str, files: str) -> Any:
    """Imports the package of an extra, or raises an ImportError with the command to install it."""
    try:
        return import_module(module)
    except ImportError:
        name = module.partition(".")[0]
        raise ImportError(f"{files} need the package {name}: pip install 'pdmp[{extra}]'") from None


class ContentError(ValueError):
    """Content of a sound file that is not what its reader expects."""


@contextmanager
def reading(path: Path, files: str) -> Iterator[None]:
    """Turns the errors of another package into one that names the file and the expected format.

    Errors of the system, such as a missing file, keep their type.
    """
    try:
        yield
    except ContentError as error:
        raise value_error(f"{path}: {error}") from None
    except Exception as error:
        if isinstance(error, OSError) and error.errno is not None and error.filename is not None:
            raise
        # Packages raise a dozen types, some without a text, some with the text of a library in C.
        reason = printable(re.sub(r"\s+", " ", str(error)).strip())[:MAX_REASON]
        raise value_error(
            f"{path}: not a {files} file, or damaged: {reason or type(error).__name__}"
        ) from None
