"""Writes figures of a model into a folder.

If its demonstrations are given, they are drawn with their reproductions too.

example: pdmp plot reach.safetensors recordings/ --columns q1 q2 q3 -o figures
"""

from argparse import ArgumentParser, Namespace

import pdmp
from pdmp import plot
from pdmp.cli.console import say
from pdmp.cli.options import (
    add_model,
    add_output,
    add_reader_options,
    file_path,
    made_folder,
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
    add_output(parser, "FOLDER", "folder for the figures, created if missing", required=True)
    add_reader_options(parser)


def run(options: Namespace) -> None:
    """Loads a model and writes its figures."""
    folder = made_folder(options.output)
    model = pdmp.load(options.model)
    first = model.styles[:, 0]
    ends = [int(first.argmin()), int(first.argmax())]
    figures = {
        "singular_values": plot.singular_values(model),
        "styles": plot.styles(model),
        "fan": plot.fan(
            model,
            *(model.conditions(end) for end in ends),
            ends=(f"demo {ends[0]}", f"demo {ends[1]}"),
        ),
    }
    if model.kind == "rhythmic":
        figures["phase_portrait"] = plot.phase_portrait(model)
    if options.paths:
        recordings = read(options.paths, **reader_arguments(options))
        figures["demonstrations"] = plot.demonstrations(model, recordings)
    for name, figure in figures.items():
        path = folder / f"{name}.png"
        plot.save(figure, path)
        say(path)
