"""Arguments, exit codes and error messages of the commands."""

import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Callable

from pdmp import PdmpError
from pdmp.cli.console import console, report, say
from pdmp.cli.options import add_output


def parser(module: str, description: str | None, output: str) -> ArgumentParser:
    """Returns the parser of a command, with an option for the folder to write to."""
    parser = ArgumentParser(
        f"python -m {module}",
        description=description,
        formatter_class=RawDescriptionHelpFormatter,
    )
    text = "folder for figures and tables; default: %(default)s"
    add_output(parser, "FOLDER", text, default=output)
    return parser


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
