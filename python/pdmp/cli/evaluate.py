"""Predicts held-out demonstrations, with a primitive and with simpler predictors.

Prints the errors. With a folder, figures and tables in Markdown are written too.

example: pdmp evaluate recordings/ --columns q1 q2 q3 --context height_m -o evaluation
"""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdmp._atomic_write import atomic_write
from pdmp.cli import _options
from pdmp.cli._console import report, say
from pdmp.cli._progress import progress
from pdmp.io import read

MOST_STYLES = 8  # of the figure of E over J


def arguments(parser: ArgumentParser) -> None:
    """Declares the arguments of the command."""
    parser.add_argument(
        "paths", nargs="+", type=_options.path, metavar="PATH", help="folder with an index.csv"
    )
    parser.add_argument(
        "-o",
        "--output",
        type=_options.path,
        metavar="FOLDER",
        help="where to write figures and tables",
    )
    _options.add_reading(parser)
    _options.add_learning(parser)
    parser.add_argument("--unit", default="", help="unit of the positions")


def run(options: Namespace) -> None:
    """Reads recordings, evaluates predictors, prints and draws the result."""
    from pdmp.evaluation import PDMP, baselines, evaluate, over_styles

    folder = options.output and Path(options.output)
    if folder:
        folder.mkdir(parents=True, exist_ok=True)
    recordings = read(options.paths, context=options.context, **_options.reading(options))
    settings = _options.settings(options)
    tried = {"kind": options.kind, "period": options.period}
    with progress() as show:
        predictors = baselines() | {"PDMP": PDMP(**settings)}
        found = evaluate(recordings, predictors=predictors, **tried, progress=show)
    report(repr(found))
    if not folder:
        return
    from pdmp import plot

    most = min(MOST_STYLES, *(len(split.train) for split in found.splits))
    del settings["n_styles"]
    with progress() as show:
        predictors = over_styles(most, **settings)
        curve = evaluate(recordings, predictors=predictors, **tried, progress=show)
    figures = {
        "held_out": plot.held_out(found, "PDMP", unit=options.unit),
        "prediction_error": plot.prediction_error(curve, unit=options.unit),
    }
    table = folder / "evaluation.md"
    with atomic_write(table) as draft:
        draft.write_text(found.markdown(), encoding="utf-8")
    say(table)
    for name, figure in figures.items():
        path = folder / f"{name}.png"
        plot.save(figure, path)
        say(path)
