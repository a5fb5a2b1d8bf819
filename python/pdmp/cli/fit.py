"""Fits a primitive to demonstrations.

example: pdmp fit recordings/ --columns q1 q2 q3 --context height_m -o reach.safetensors
"""

from argparse import ArgumentParser, Namespace
from pathlib import Path

import pdmp
from pdmp.cli import _options
from pdmp.cli._console import say
from pdmp.cli._progress import progress
from pdmp.io import read


def arguments(parser: ArgumentParser) -> None:
    """Declares the arguments of the command."""
    parser.add_argument(
        "paths",
        type=_options.path,
        nargs="+",
        metavar="PATH",
        help="CSV or BVH file (one demonstration), NPZ file (several) or folder with an index.csv",
    )
    parser.add_argument(
        "-o", "--output", type=_options.path, required=True, metavar="FILE", help="model to write"
    )
    _options.add_reading(parser)
    _options.add_learning(parser)


def run(options: Namespace) -> None:
    """Reads demonstrations, fits a model and writes it."""
    output = Path(options.output).absolute()
    if not output.parent.is_dir():
        raise FileNotFoundError(f"{output.parent}: no such folder; make it first")
    if output.is_dir():
        raise IsADirectoryError(f"{output}: a folder; name a file in it")
    recordings = read(options.paths, context=options.context, **_options.reading(options))
    with progress() as show:
        model = pdmp.fit(
            recordings,
            kind=options.kind,
            period=options.period,
            **_options.settings(options),
            progress=show,
        )
    model.save(options.output)
    say(f"{options.output}: {model!r}")
