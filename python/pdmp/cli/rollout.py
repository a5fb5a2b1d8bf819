"""Writes a movement as CSV.

The style is that of the nominal demonstration unless --style, --context or --demo is given.

example: pdmp rollout reach.safetensors --context 1.45 --goal 0.4 -0.2 0.9 -o reach.csv
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from typing import Any

import pdmp
from pdmp.cli.options import add_model, add_output
from pdmp.cli.streams import inputs, output, summarise


def arguments(parser: ArgumentParser) -> None:
    """Declares the arguments of the command."""
    add_model(parser)
    add_output(parser, "FILE", "CSV to write; - is standard output", stream=True, required=True)
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--style", nargs="+", type=float, metavar="S", help="style parameters")
    source.add_argument(
        "--context",
        nargs="+",
        metavar="C",
        help="context to predict the movement for, as values or as NAME=VALUE",
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
    with output(options.output) as path:
        with inputs([options.model]) as (file,):
            model = pdmp.load(file)
        conditions = None if options.demo is None else model.conditions(options.demo)
        positions = ("goal", "goal_velocity", "start", "velocity", "anchor")
        names = ("style", *positions, "amplitude", "tau", "dt", "duration")
        arguments = {name: value for name in names if (value := getattr(options, name)) is not None}
        if options.context is not None:
            arguments["context"] = _context(options.context)
        trajectory = model.rollout(conditions, **arguments)
        trajectory.to_csv(path)
    summarise(options.output, f"{len(trajectory.time)} samples, {trajectory.time[-1]:g} s")


def _context(texts: Sequence[str]) -> Any:
    """Returns a context, by name if every text is NAME=VALUE."""
    parts = [text.partition("=") for text in texts]
    if all(sign and name for name, sign, _ in parts):
        return {name: _value(value) for name, _, value in parts}
    return [_value(text) for text in texts]


def _value(text: str) -> float | str:
    """Returns a number, or a label."""
    try:
        return float(text)
    except ValueError:
        return text
