"""Options that several commands share."""

from argparse import ArgumentParser


def add_reading(parser: ArgumentParser) -> None:
    """Add the options that tell how demonstrations are read."""
    parser.add_argument(
        "--columns", nargs="+", metavar="NAME", help="degrees of freedom to keep; default: all"
    )
    parser.add_argument(
        "--dt", type=float, metavar="S", help="sampling interval [s], in place of time stamps"
    )
