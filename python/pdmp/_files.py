"""Atomic replacement of files."""

import errno
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pdmp._messages import check_type


def file_path(path: str | os.PathLike[str], name: str = "path") -> Path:
    """Returns the path of an argument."""
    check_type(name, path, (str, os.PathLike), "the path of a file or folder")
    return Path(path)


def check_folder(path: Path) -> None:
    """Raises FileNotFoundError if the folder of a file does not exist."""
    if not path.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such folder; create it first", str(path.parent))


@contextmanager
def atomic_write(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yields a temporary path, whose file replaces `path` when the block ends without an error.

    After an error or an interruption the former file is unchanged and the temporary one is removed.
    Symbolic links are followed. A pipe or a device is written directly. The folder must exist: one
    that was mistyped is not created.
    """
    path = file_path(path)
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    check_folder(path)
    if path.exists() and not path.is_file():
        yield path
        return
    target = path.resolve()
    # The name is unique to a thread, and short: a suffix could exceed the limit of the file system.
    draft = target.with_name(f".pdmp-{os.getpid()}-{threading.get_ident()}.draft")
    try:
        yield draft
        if target.exists():
            # Imported here, since `import pdmp` need not wait for it.
            import shutil

            shutil.copymode(target, draft)
        os.replace(draft, target)
    except OSError as error:
        if error.filename == str(draft):
            error.filename = str(path)
        raise
    finally:
        draft.unlink(missing_ok=True)


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Yields a temporary folder, in which the block makes the folder `path.name` that is kept.

    The folder of `path` must exist, and `path` must not. After an error nothing remains.
    """
    # Imported here, since `import pdmp` need not wait for it.
    import tempfile

    check_folder(path)
    if path.exists():
        raise FileExistsError(errno.EEXIST, "exists; name a new folder", str(path))
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".pdmp-") as draft:
        yield Path(draft)
        os.replace(Path(draft) / path.name, path)
