"""Progress of a long call, on standard error."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress() -> Iterator[Callable[[str, float], None]]:
    """Yields a function that prints the stage of a fit and its completed fraction.

    On a terminal both are updated in place until the fit ends; elsewhere each stage is one line.
    """
    live = sys.stderr.isatty()
    stages: list[str] = []

    def show(stage: str, share: float) -> None:
        if live:
            print(f"\r\x1b[K{stage} {share:.0%}", end="", file=sys.stderr, flush=True)
        elif stage not in stages:
            stages.append(stage)
            print(f"learning: {stage}", file=sys.stderr)

    try:
        yield show
    finally:
        if live:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
