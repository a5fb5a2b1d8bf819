"""Parametric dynamic movement primitives: fits, rollouts, evaluations and figures."""

import os
import re
import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Mapping, Sequence

from pdmp._messages import printable
from pdmp._native import PdmpError, __version__
from pdmp.cli import cycles, evaluate, explore, fit, info, plot, rollout
from pdmp.cli.console import console, one_line, option_names, short_warnings

_NEGATIVE_NUMBER = re.compile(r"-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")
COMMANDS = {
    "fit": fit,
    "cycles": cycles,
    "rollout": rollout,
    "evaluate": evaluate,
    "info": info,
    "plot": plot,
    "explore": explore,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; those of the process by default.

    Returns
    -------
    int
        Exit code: 0 for success, 1 for an error, reported in one line on standard error, and
        130 after an interruption.

    Raises
    ------
    SystemExit
        With code 2 for wrong usage, with code 0 after `--help` and `--version`.
    """
    with console():
        return _run(_parser().parse_args(argv))


def _run(options: Namespace) -> int:
    """Runs a command and returns the exit code."""
    try:
        with short_warnings(options.options):
            options.run(options)
        sys.stdout.flush()
    except KeyboardInterrupt:
        print("pdmp: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader of the output has closed it; flushing the rest must not raise an error at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (PdmpError, ValueError, OSError, ImportError, MemoryError) as error:
        print(f"pdmp: error: {_error_text(error, options.options)}", file=sys.stderr)
        return 1
    return 0


def _parser() -> ArgumentParser:
    parser = ArgumentParser("pdmp", description=__doc__)
    parser.add_argument("--version", action="version", version=f"pdmp {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, command in COMMANDS.items():
        description = command.__doc__ or ""
        command_parser = commands.add_parser(
            name,
            help=description.splitlines()[0].rstrip("."),
            description=description,
            epilog=getattr(command, "EPILOG", None),
            formatter_class=RawDescriptionHelpFormatter,
        )
        # Before Python 3.14 argparse parses -1e-3 as an option.
        command_parser._negative_number_matcher = _NEGATIVE_NUMBER
        command.arguments(command_parser)
        command_parser.set_defaults(run=command.run, options=option_names(command_parser))
    return parser


def _error_text(error: Exception, options: Mapping[str, str]) -> str:
    """Returns an error in one line, with command-line options for arguments of Python."""
    if isinstance(error, OSError) and error.filename is not None:
        return printable(f"{error.filename}: {error.strerror}")
    return one_line(error, options)
