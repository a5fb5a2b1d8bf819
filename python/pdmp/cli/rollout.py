"""Writes a movement as CSV.

The style is that of the nominal demonstration unless one of --style, --context and --demo is given.

example: pdmp rollout reach.safetensors --context 1.45 --goal 0.4 -0.2 0.9 -o reach.csv
"""

import sys
from argparse import ArgumentParser, Namespace

import pdmp
from pdmp.cli._console import say
from pdmp.cli._options import path


def arguments(parser: ArgumentParser) -> None:
    """Declares the arguments of the command."""
    parser.add_argument("model", type=path, metavar="MODEL", help="model file")
    parser.add_argument(
        "-o", "--output", type=path, required=True, metavar="FILE", help="CSV to write"
    )
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--style", nargs="+", type=float, metavar="S", help="style parameters")
    which.add_argument("--context", nargs="+", type=_value, metavar="C", help="context to meet")
    which.add_argument("--demo", type=int, metavar="M", help="demonstration to repeat, from 0")
    for name, text in (
        ("goal", "where a discrete movement ends"),
        ("start", "where it starts"),
        ("anchor", "centre of a rhythmic movement"),
    ):
        parser.add_argument(f"--{name}", nargs="+", type=float, metavar="Y", help=text)
    for name, metavar, text in (
        ("amplitude", "R", "amplitude of a rhythmic movement, 1 as demonstrated"),
        ("tau", "S", "time constant [s]"),
        ("dt", "S", "sampling interval [s]; default: 0.01"),
        ("duration", "S", "duration [s]; default: as demonstrated, or one period"),
    ):
        parser.add_argument(f"--{name}", type=float, metavar=metavar, help=text)


def run(options: Namespace) -> None:
    """Loads a model, rolls it out and writes the movement."""
    model = pdmp.load(options.model)
    conditions = None if options.demo is None else model.conditions(options.demo)
    names = ("style", "context", "goal", "start", "anchor", "amplitude", "tau", "dt", "duration")
    given = {name: value for name in names if (value := getattr(options, name)) is not None}
    trajectory = model.rollout(conditions, **given)
    if options.context is not None and model.predict(options.context).extrapolation.any():
        print("pdmp: the context lies outside of those demonstrated", file=sys.stderr)
    trajectory.to_csv(options.output)
    say(f"{options.output}: {len(trajectory.time)} samples, {trajectory.time[-1]:g} s")


def _value(text: str) -> float | str:
    """Returns a number, or a label."""
    try:
        return float(text)
    except ValueError:
        return text
