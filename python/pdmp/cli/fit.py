"""Fits a primitive to demonstrations.

example: pdmp fit recordings/ --columns q1 q2 q3 --context height_m -o reach.safetensors
"""

from argparse import ArgumentParser, Namespace

import pdmp
from pdmp.cli.console import say
from pdmp.cli.options import (
    add_fit_options,
    add_output,
    add_reader_options,
    check_file,
    file_path,
    fit_arguments,
    reader_arguments,
)
from pdmp.cli.progress import progress
from pdmp.io import read


def arguments(parser: ArgumentParser) -> None:
    """Declares the arguments of the command."""
    parser.add_argument(
        "paths",
        type=file_path,
        nargs="+",
        metavar="PATH",
        help="CSV or BVH file (one demonstration), NPZ file (several) or folder with an index.csv",
    )
    add_output(parser, "FILE", "model to write", required=True)
    add_reader_options(parser)
    add_fit_options(parser)


def run(options: Namespace) -> None:
    """Reads demonstrations, fits a model and saves it."""
    check_file(options.output)
    recordings = read(options.paths, context=options.context, **reader_arguments(options))
    with progress() as show:
        model = pdmp.fit(
            recordings,
            kind=options.kind,
            period=options.period,
            **fit_arguments(options),
            progress=show,
        )
    model.save(options.output)
    say(f"{options.output}: {model!r}")
