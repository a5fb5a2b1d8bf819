"""Writes a page with a model to explore in a browser.

The page is one HTML file that needs neither a server nor a network. If the demonstrations of the
model are given, they are drawn behind the movement.

example: pdmp explore reach.safetensors recordings/ -o reach.html
"""

from argparse import ArgumentParser, Namespace

import pdmp
from pdmp.cli.formats import FORMATS
from pdmp.cli.options import (
    add_model,
    add_output,
    add_reader_options,
    add_recordings,
    file_path,
    reader_arguments,
)
from pdmp.cli.streams import inputs, output, summarise
from pdmp.io import read

EPILOG = FORMATS


def arguments(parser: ArgumentParser) -> None:
    """Declares the arguments of the command."""
    add_model(parser)
    add_recordings(parser, "*")
    add_output(
        parser, "FILE", "HTML file to write; - is standard output", stream=True, required=True
    )
    parser.add_argument(
        "--dofs", nargs="+", metavar="NAME", help="degrees of freedom with diagrams at first"
    )
    parser.add_argument(
        "--urdf",
        type=file_path,
        metavar="FILE",
        help="description of the robot, whose joints have the names of the degrees of freedom, for "
        "limits",
    )
    parser.add_argument("--title", metavar="TEXT", help="heading of the page")
    add_reader_options(parser)


def run(options: Namespace) -> None:
    """Loads a model and writes its page."""
    with output(options.output) as path:
        with inputs([options.model, *options.paths]) as (model_path, *paths):
            model = pdmp.load(model_path)
            recordings = read(paths, **reader_arguments(options)) if paths else None
        limits = None if options.urdf is None else pdmp.Limits.from_urdf(options.urdf, model.names)
        page = model.explorer(
            path,
            demonstrations=recordings,
            limits=limits,
            dofs=options.dofs,
            title=options.title,
        )
    summarise(options.output, f"{len(page.html.encode()) // 1000} kB")
