"""Learn human handwriting and show what the primitive can do; needs the extra demo.

example: pdmp demo -o demo
"""

from argparse import ArgumentParser, Namespace

from pdmp.cli._console import report
from pdmp.cli._options import path
from pdmp.cli._progress import progress
from pdmp.demo import run_demo


def arguments(parser: ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        "-o",
        "--output",
        type=path,
        default="demo",
        metavar="FOLDER",
        help="where to write; default: demo",
    )


def run(options: Namespace) -> None:
    """Run the demo and print its report."""
    with progress() as show:
        text = run_demo(options.output, progress=show)
    report(text)
