"""Reproduces the figures and tables of the paper on a simulated robot.

example: python -m reproduction fig3 -o out/reproduction
"""

import sys
from argparse import ArgumentParser
from collections.abc import Sequence

from pdmp.cli.options import file_path
from reproduction import command
from reproduction.run import FIGURES, reproduce
from reproduction.section import SEED


def main(argv: Sequence[str] | None = None) -> int:
    """Runs `python -m reproduction` and returns its exit code."""
    options = _parser().parse_args(argv)
    return command.run(
        lambda: reproduce(
            options.figure,
            options.output,
            options.recordings,
            options.seed,
            progress=lambda name: print(f"reproducing {name}", file=sys.stderr),
        )
    )


def _parser() -> ArgumentParser:
    parser = command.parser("reproduction", __doc__, output="out/reproduction")
    parser.add_argument(
        "figure",
        choices=(*FIGURES, "all"),
        help="figure of Matsubara, Hyon and Morimoto (2011), or comparison with other methods",
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=SEED,
        metavar="N",
        help="seed of the noise in the demonstrations; default: %(default)s",
    )
    parser.add_argument(
        "--recordings",
        type=file_path,
        metavar="FOLDER",
        help="for fig5, CSV files of people walking: t [s]; r_sh1, r_sh2, r_sh3, r_elb, l_sh1, … "
        "[rad]",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
