"""Writes a page with a model to explore in a browser.

The page is one HTML file that needs neither a server nor a network. If the demonstrations of the
model are given, they are drawn behind the movement.

example: pdmp explore reach.safetensors recordings/ -o reach.html
"""

from argparse import ArgumentParser, Namespace

import pdmp
from pdmp.cli.console import say
from pdmp.cli.options import (
    add_model,
    add_output,
    add_reader_options,
    check_file,
    file_path,
    reader_arguments,
)
from pdmp.io import read


def arguments(parser: ArgumentParser) -> None:
    """Declares the arguments of the command."""
    add_model(parser)
    parser.add_argument(
        "paths",
        nargs="*",
        type=file_path,
        metavar="PATH",
        help="its demonstrations, as for pdmp fit",
    )
    add_output(parser, "FILE", "HTML file to write", required=True)
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
    check_file(options.output)
    model = pdmp.load(options.model)
    limits = None if options.urdf is None else pdmp.Limits.from_urdf(options.urdf, model.names)
    recordings = read(options.paths, **reader_arguments(options)) if options.paths else None
    page = model.explorer(
        options.output,
        demonstrations=recordings,
        limits=limits,
        dofs=options.dofs,
        title=options.title,
    )
    say(f"{options.output}: {len(page.html.encode()) // 1000} kB")
