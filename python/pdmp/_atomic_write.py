"""Atomic replacement of files."""

import errno
import os
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_write(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yields a temporary path, whose file replaces `path` when the block ends without an error.

    An error or an interruption leaves what was at `path` before, and nothing beside it. What a link
    leads to is replaced, not the link; a pipe or a device is written to.
    """
    path = Path(path)
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.exists() and not path.is_file():
        yield path
        return
    place = path.resolve()
    # No two threads share a draft, and a long name stays short enough for the file system.
    draft = place.with_name(f".pdmp-{os.getpid()}-{threading.get_ident()}.draft")
    try:
        yield draft
        if place.exists():
            shutil.copymode(place, draft)
        os.replace(draft, place)
    except OSError as error:
        if error.filename == str(draft):
            error.filename = str(path)
        raise
    finally:
        draft.unlink(missing_ok=True)
