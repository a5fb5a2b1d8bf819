"""Options that several commands share."""

from argparse import ArgumentParser, Namespace
from typing import Any


def add_reading(parser: ArgumentParser) -> None:
    """Add the options that tell how demonstrations are read."""
    parser.add_argument(
        "--columns", nargs="+", metavar="NAME", help="degrees of freedom to keep; default: all"
    )
    parser.add_argument(
        "--dt", type=float, metavar="S", help="sampling interval [s], in place of time stamps"
    )
    parser.add_argument(
        "--max-gap",
        type=float,
        default=0.0,
        metavar="S",
        help="longest gap [s] that is interpolated; default: none is",
    )


def reading(options: Namespace) -> dict[str, Any]:
    """Return the arguments of `pdmp.demos.read` that these options are."""
    return {name: getattr(options, name) for name in ("columns", "dt", "max_gap")}
