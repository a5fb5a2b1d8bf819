"""Learn a primitive from demonstrations.

example: pdmp fit recordings/ --columns q1 q2 q3 --context height_m -o reach.safetensors
"""

from argparse import ArgumentParser, Namespace
from pathlib import Path

import pdmp
from pdmp import demos
from pdmp.cli import _options
from pdmp.cli._progress import progress


def arguments(parser: ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        "paths",
        nargs="+",
        metavar="PATH",
        help="CSV or BVH file (one demonstration), NPZ file (several) or folder with an index.csv",
    )
    parser.add_argument("-o", "--output", required=True, metavar="FILE", help="model to write")
    _options.add_reading(parser)
    parser.add_argument(
        "--context", nargs="+", metavar="NAME", help="columns of index.csv that make the context"
    )
    parser.add_argument(
        "--kind",
        choices=["discrete", "rhythmic"],
        default="discrete",
        help="from start to goal (default), or one cycle per demonstration",
    )
    parser.add_argument("--period", type=float, metavar="S", help="period of rhythmic ones [s]")
    parser.add_argument("--styles", type=int, metavar="J", help="number of style parameters")
    parser.add_argument(
        "--spectrum",
        type=float,
        default=0.9,
        metavar="SHARE",
        help="without --styles: share of the singular-value sum to keep; default: 0.9",
    )
    parser.add_argument(
        "--basis",
        choices=["gp", "ngnet"],
        default="gp",
        help="Gaussian process (default) or normalised Gaussian network",
    )
    parser.add_argument(
        "--smoothing", type=_smoothing, metavar="HZ", help="cut-off [Hz], or auto; default: none"
    )


def run(options: Namespace) -> None:
    """Read, learn, write."""
    folder = Path(options.output).absolute().parent
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder; make it first")
    recordings = demos.read(options.paths, context=options.context, **_options.reading(options))
    with progress() as show:
        model = pdmp.fit(
            recordings,
            kind=options.kind,
            period=options.period,
            n_styles=options.styles,
            spectrum=options.spectrum,
            basis=options.basis,
            smoothing=options.smoothing,
            progress=show,
        )
    model.save(options.output)
    print(f"{options.output}: {model!r}")


def _smoothing(text: str) -> str | float:
    return text if text == "auto" else float(text)
