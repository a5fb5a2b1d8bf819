"""Predicts held-out demonstrations with a primitive and with simpler predictors.

Prints the errors. With --output, figures and tables in Markdown are written too.

example: pdmp evaluate recordings/ --columns q1 q2 q3 --context height_m -o evaluation
"""

from argparse import ArgumentParser, Namespace

from pdmp._files import atomic_write
from pdmp.cli.console import report, say
from pdmp.cli.formats import FORMATS
from pdmp.cli.options import (
    add_fit_options,
    add_output,
    add_reader_options,
    add_recordings,
    fit_arguments,
    made_folder,
    period_argument,
    reader_arguments,
)
from pdmp.cli.progress import progress
from pdmp.cli.streams import inputs
from pdmp.io import read

EPILOG = FORMATS
MAX_STYLES = 8  # in the figure of E over J


def arguments(parser: ArgumentParser) -> None:
    """Declares the arguments of the command."""
    add_recordings(parser)
    add_output(parser, "FOLDER", "folder for figures and tables, created if missing")
    add_reader_options(parser)
    add_fit_options(parser)
    parser.add_argument("--unit", default="", help="unit of the positions in the figures")


def run(options: Namespace) -> None:
    """Reads recordings, evaluates predictors, prints and draws the results."""
    from pdmp.evaluation import PDMP, baselines, evaluate, over_styles

    folder = made_folder(options.output) if options.output else None
    with inputs(options.paths) as paths:
        recordings = read(paths, context=options.context, **reader_arguments(options))
    settings = fit_arguments(options)
    data = {"kind": options.kind, "period": period_argument(options)}
    with progress() as show:
        predictors = baselines() | {"PDMP": PDMP(**settings)}
        result = evaluate(recordings, predictors=predictors, **data, progress=show)
    report(repr(result))
    if not folder:
        return
    from pdmp import plot

    max_styles = min(MAX_STYLES, *(len(split.train) for split in result.splits))
    del settings["n_styles"]
    with progress() as show:
        predictors = over_styles(max_styles, **settings)
        curve = evaluate(recordings, predictors=predictors, **data, progress=show)
    figures = {
        "held_out": plot.held_out(result, "PDMP", unit=options.unit),
        "prediction_error": plot.prediction_error(curve, unit=options.unit),
    }
    table = folder / "evaluation.md"
    with atomic_write(table) as draft:
        draft.write_text(result.markdown(), encoding="utf-8")
    say(table)
    for name, figure in figures.items():
        path = folder / f"{name}.png"
        plot.save(figure, path)
        say(path)
