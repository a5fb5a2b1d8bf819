"""Writes figures of a model into a folder.

If its demonstrations are given, they are drawn with their reproductions too.

example: pdmp plot reach.safetensors recordings/ -o figures
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from typing import Any

import pdmp
from pdmp import plot
from pdmp.cli.console import say
from pdmp.cli.formats import FORMATS
from pdmp.cli.options import (
    add_model,
    add_output,
    add_reader_options,
    add_recordings,
    made_folder,
    reader_arguments,
)
from pdmp.cli.streams import inputs
from pdmp.io import read

EPILOG = FORMATS
MIN_CYCLES = 1.4
"""Smallest duration of a recording that is cut into cycles, in periods of the model."""


def arguments(parser: ArgumentParser) -> None:
    """Declares the arguments of the command."""
    add_model(parser)
    add_recordings(parser, "*")
    add_output(parser, "FOLDER", "folder for the figures, created if missing", required=True)
    add_reader_options(parser)


def run(options: Namespace) -> None:
    """Loads a model and writes its figures."""
    folder = made_folder(options.output)
    with inputs([options.model, *options.paths]) as (model_path, *paths):
        model = pdmp.load(model_path)
        recordings = read(paths, **_columns(model, options))
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
    if recordings:
        recordings = _cycles(model, recordings)
        figures["demonstrations"] = plot.demonstrations(model, recordings)
    for name, figure in figures.items():
        path = folder / f"{name}.png"
        plot.save(figure, path)
        say(path)


def _columns(model: pdmp.Model, options: Namespace) -> dict[str, Any]:
    """Returns the arguments of the readers, by default for the columns of the model."""
    arguments = reader_arguments(options)
    names = list(model.coordinate_names)
    if arguments["columns"] is None and names != [f"y{d}" for d in range(len(names))]:
        arguments["columns"] = names
    return arguments


def _cycles(model: pdmp.Model, recordings: Sequence[pdmp.Demonstration]) -> Any:
    """Returns the cycles of recordings that are longer than those of a rhythmic model."""
    times = [demo.time for demo in recordings]
    longest = max((float(time[-1] - time[0]) for time in times if time is not None), default=0.0)
    if model.kind == "discrete" or longest < MIN_CYCLES * model.durations.max():
        return recordings
    average = len(recordings) == model.n_demos
    return pdmp.preprocessing.cycles(recordings, average=average)
