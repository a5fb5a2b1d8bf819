"""Fits a primitive to demonstrations.

example: pdmp fit recordings/ --columns q1 q2 q3 --context height_m -o reach.safetensors
"""

from argparse import ArgumentParser, Namespace

import pdmp
from pdmp.cli.formats import FORMATS
from pdmp.cli.options import (
    add_fit_options,
    add_output,
    add_reader_options,
    add_recordings,
    fit_arguments,
    period_argument,
    reader_arguments,
)
from pdmp.cli.progress import progress
from pdmp.cli.streams import inputs, output, summarise
from pdmp.io import read

EPILOG = FORMATS


def arguments(parser: ArgumentParser) -> None:
    """Declares the arguments of the command."""
    add_recordings(parser)
    add_output(parser, "FILE", "model to write; - is standard output", stream=True, required=True)
    add_reader_options(parser)
    add_fit_options(parser)


def run(options: Namespace) -> None:
    """Reads demonstrations, fits a model and saves it."""
    with output(options.output) as path:
        with inputs(options.paths) as paths:
            recordings = read(paths, context=options.context, **reader_arguments(options))
        with progress() as show:
            model = pdmp.fit(
                recordings,
                kind=options.kind,
                period=period_argument(options),
                **fit_arguments(options),
                progress=show,
            )
        model.save(path)
    summarise(options.output, repr(model))
