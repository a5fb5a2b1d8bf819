"""Make the figures of the paper, on a simulated robot; needs the extra reproduce.

example: pdmp reproduce fig3 -o reproduction
"""

import sys
from argparse import ArgumentParser, Namespace

from pdmp.cli._console import report
from pdmp.cli._options import path
from pdmp.reproduction import FIGURES, reproduce
from pdmp.reproduction.section import SEED


def arguments(parser: ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        "figure",
        choices=(*FIGURES, "all"),
        help="a figure of Matsubara, Hyon and Morimoto (2011), or how others fare at its tasks",
    )
    parser.add_argument(
        "-o",
        "--output",
        default="reproduction",
        type=path,
        metavar="FOLDER",
        help="where pictures and tables go; default: reproduction",
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=SEED,
        metavar="N",
        help="of the noise in the demonstrations, another person as it were; default: %(default)s",
    )
    parser.add_argument(
        "--recordings",
        type=path,
        metavar="FOLDER",
        help="for fig5, CSV files of people walking: t [s]; r_sh1, r_sh2, r_sh3, r_elb, l_sh1, … "
        "[rad]",
    )


def run(options: Namespace) -> None:
    """Make what was asked for, and print its tables."""
    text = reproduce(
        options.figure,
        options.output,
        options.recordings,
        options.seed,
        progress=lambda name: print(f"making {name}", file=sys.stderr),
    )
    report(text)
