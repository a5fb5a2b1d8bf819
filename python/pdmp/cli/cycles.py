"""Fits a rhythmic primitive to raw recordings of a cyclic movement, such as walking.

The recordings are cut into cycles that begin at a common phase; outlying cycles are left out.

example: pdmp cycles walk.csv --columns hip knee ankle -o walk.safetensors
"""

import sys
from argparse import ArgumentParser, Namespace

import pdmp
from pdmp._messages import printable
from pdmp.cli.formats import FORMATS
from pdmp.cli.options import (
    add_fit_options,
    add_output,
    add_reader_options,
    add_recordings,
    fit_arguments,
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
    parser.add_argument(
        "--average", action="store_true", help="fit the mean cycle of each recording"
    )
    add_fit_options(parser, rhythmic=True)


def run(options: Namespace) -> None:
    """Reads recordings, cuts them into cycles, fits a model and saves it."""
    with output(options.output) as path:
        with inputs(options.paths) as paths:
            recordings = read(paths, context=options.context, **reader_arguments(options))
        cycles = pdmp.preprocessing.cycles(recordings, average=options.average)
        with progress() as show:
            model = pdmp.fit(
                cycles,
                **fit_arguments(options),
                progress=show,
            )
        model.save(path)
    summarise(options.output, f"{cycles!r}")
    # A warning has reported recordings without any cycle.
    for each in (each for each in cycles.rejected if each.recording in cycles.recordings):
        detail = f"recording {each.recording}, {each.start:.2f} to {each.start + each.period:.2f} s"
        print(f"pdmp: rejected {detail}: {printable(each.reason)}", file=sys.stderr)
    summarise(options.output, repr(model))
