"""Fits one primitive to five handwritten shapes; writes model, figures and a report.

example: python -m reproduction.demo -o out/demo
"""

import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Sequence

from pdmp.cli.options import file_path
from pdmp.cli.progress import progress
from reproduction import command
from reproduction.demo.run import run_demo


def main(argv: Sequence[str] | None = None) -> int:
    """Runs `python -m reproduction.demo` and returns its exit code."""
    parser = ArgumentParser(
        "python -m reproduction.demo",
        description=__doc__,
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "-o",
        "--output",
        type=file_path,
        default="out/demo",
        metavar="FOLDER",
        help="folder to write to; default: %(default)s",
    )
    folder = parser.parse_args(argv).output

    def make_report() -> str:
        with progress() as show:
            return run_demo(folder, progress=show)

    return command.run(make_report)


if __name__ == "__main__":
    sys.exit(main())
