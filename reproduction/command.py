"""Exit codes and error messages of the commands."""

import sys
from collections.abc import Callable

from pdmp import PdmpError
from pdmp.cli.console import console, report, say


def run(make_report: Callable[[], str]) -> int:
    """Prints a report, or the error that prevents it; returns the exit code.

    Returns
    -------
    int
        0 for success, 1 after an error, 130 after an interruption.
    """
    with console():
        try:
            report(make_report())
        except KeyboardInterrupt:
            say("interrupted", file=sys.stderr)
            return 130
        except (PdmpError, ValueError, OSError, ImportError) as error:
            say(f"error: {error}", file=sys.stderr)
            return 1
    return 0
