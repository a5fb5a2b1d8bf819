"""Writes a movement as CSV.

The style is that of the nominal demonstration unless --style, --context or --demo is given.

example: pdmp rollout reach.safetensors --context 1.45 --goal 0.4 -0.2 0.9 -o reach.csv
"""

import sys
from argparse import ArgumentParser, Namespace

import pdmp
from pdmp.cli.console import say
from pdmp.cli.options import add_model, add_output, check_file


def arguments(parser: ArgumentParser) -> None:
    """Declares the arguments of the command."""
    add_model(parser)
    add_output(parser, "FILE", "CSV to write", required=True)
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--style", nargs="+", type=float, metavar="S", help="style parameters")
    source.add_argument(
        "--context", nargs="+", type=_value, metavar="C", help="context to predict the movement for"
    )
    source.add_argument(
        "--demo", type=int, metavar="M", help="demonstration to reproduce, counted from 0"
    )
    for name, metavar, text in (
        ("goal", "Y", "goal of a discrete movement"),
        ("goal-velocity", "V", "velocity [1/s] at the goal of a discrete movement"),
        ("start", "Y", "start position"),
        ("velocity", "V", "start velocity [1/s]"),
        ("anchor", "Y", "centre of a rhythmic movement"),
    ):
        parser.add_argument(f"--{name}", nargs="+", type=float, metavar=metavar, help=text)
    for name, metavar, text in (
        ("amplitude", "R", "amplitude of a rhythmic movement, relative to the demonstrations"),
        ("tau", "S", "time constant [s]"),
        ("dt", "S", "sampling interval [s]; default: 0.01"),
        ("duration", "S", "duration [s]; default: as demonstrated, or one period"),
    ):
        parser.add_argument(f"--{name}", type=float, metavar=metavar, help=text)


def run(options: Namespace) -> None:
    """Loads a model, computes a rollout and writes it."""
    check_file(options.output)
    model = pdmp.load(options.model)
    conditions = None if options.demo is None else model.conditions(options.demo)
    positions = ("goal", "goal_velocity", "start", "velocity", "anchor")
    names = ("style", "context", *positions, "amplitude", "tau", "dt", "duration")
    arguments = {name: value for name in names if (value := getattr(options, name)) is not None}
    trajectory = model.rollout(conditions, **arguments)
    if options.context is not None and model.predict(options.context).extrapolation.any():
        print("pdmp: the context lies outside the demonstrated ones", file=sys.stderr)
    trajectory.to_csv(options.output)
    say(f"{options.output}: {len(trajectory.time)} samples, {trajectory.time[-1]:g} s")


def _value(text: str) -> float | str:
    """Returns a number, or a label."""
    try:
        return float(text)
    except ValueError:
        return text
