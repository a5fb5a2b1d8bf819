"""Options shared by several commands."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pdmp._files import check_folder


def file_path(text: str) -> str:
    """Returns the path of a file or folder; rejects -, which stands for a stream elsewhere."""
    if text == "-":
        raise ArgumentTypeError("- is not a file: name one, or write ./- for a file called -")
    return text


def stream_path(text: str) -> str:
    """Returns the path of a file or folder, or - for standard input or output."""
    return text


def add_output(
    parser: ArgumentParser, metavar: str, text: str, *, stream: bool = False, **settings: Any
) -> None:
    """Adds the option for the file or folder to write, with further settings of the argument.

    With `stream`, the file may be standard output.
    """
    kind = stream_path if stream else file_path
    parser.add_argument("-o", "--output", type=kind, metavar=metavar, help=text, **settings)


def add_model(parser: ArgumentParser) -> None:
    """Adds the argument for the model file to read."""
    parser.add_argument(
        "model", type=stream_path, metavar="MODEL", help="model file; - is standard input"
    )


def add_recordings(parser: ArgumentParser, nargs: str = "+") -> None:
    """Adds the argument for the recordings to read."""
    text = "files and folders of recordings, see below; - is standard input"
    parser.add_argument("paths", type=stream_path, nargs=nargs, metavar="PATH", help=text)


def made_folder(path: str) -> Path:
    """Returns a folder, which is created if it does not exist, in a folder that exists."""
    folder = Path(path)
    check_folder(folder)
    folder.mkdir(exist_ok=True)
    return folder


def add_reader_options(parser: ArgumentParser) -> None:
    """Adds the options of the readers of recordings."""
    parser.add_argument(
        "--columns", nargs="+", metavar="NAME", help="degrees of freedom to keep; default: all"
    )
    parser.add_argument(
        "--time",
        default="t",
        metavar="NAME",
        help="CSV column of the time stamps, followed by [ms], [us] or [ns] if its header gives no "
        "unit; default: t or time",
    )
    parser.add_argument(
        "--dt", type=float, metavar="S", help="sampling interval [s], in place of time stamps"
    )
    parser.add_argument(
        "--max-gap",
        type=float,
        default=0.0,
        metavar="S",
        help="longest gap [s] to interpolate; default: 0, none",
    )


def reader_arguments(options: Namespace) -> dict[str, Any]:
    """Returns the arguments of `pdmp.io.read`, other than the context."""
    return {name: getattr(options, name) for name in ("columns", "time", "dt", "max_gap")}


def add_fit_options(parser: ArgumentParser, *, rhythmic: bool = False) -> None:
    """Adds the options of a fit, without those of the kind if it is `rhythmic`."""
    parser.add_argument(
        "--context", nargs="+", metavar="NAME", help="columns of index.csv that form the context"
    )
    for name, choices, text in (
        (
            "map",
            ("auto", "stacked", "gp", "linear", "polynomial"),
            "map from contexts to movements",
        ),
        ("kind", ("discrete", "rhythmic"), "from start to goal, or one cycle per demonstration"),
        ("alignment", ("linear", "warp"), "alignment in time with the nominal demonstration"),
        ("basis", ("gp", "ngnet"), "Gaussian process or normalised Gaussian network"),
    ):
        if rhythmic and name == "kind":
            parser.set_defaults(kind="rhythmic", transport=None)
            continue
        text = f"{text}; default: %(default)s"
        parser.add_argument(f"--{name}", choices=choices, default=choices[0], help=text)
    if not rhythmic:
        parser.add_argument(
            "--transport",
            choices=("learnt", "immediate"),
            help="distribution of changes of start or goal in time, of discrete movements; "
            "default: learnt",
        )
        parser.add_argument(
            "--period",
            type=float,
            nargs="+",
            metavar="S",
            help="period of rhythmic demonstrations [s], one or one of each",
        )
    parser.add_argument(
        "--styles",
        type=_or_named(int, "whole number", auto="auto"),
        metavar="J",
        help="number of style parameters J, or auto: selected by cross-validation over contexts",
    )
    parser.add_argument(
        "--singular-value-share",
        type=float,
        metavar="SHARE",
        help="without --styles: smallest J whose share of the sum of singular values exceeds this, "
        "0.9 in the paper; default: the systematic styles, those above the measurement noise",
    )
    parser.add_argument(
        "--smoothing",
        type=_or_named(float, "frequency [Hz]", auto="auto", none=None),
        default="auto",
        metavar="HZ",
        help="cut-off [Hz], auto (default: by cross-validation), or none",
    )


def fit_arguments(options: Namespace) -> dict[str, Any]:
    """Returns the arguments of `pdmp.fit` other than kind and period."""
    return {
        "map": options.map,
        "alignment": options.alignment,
        "n_styles": options.styles,
        "singular_value_share": options.singular_value_share,
        "basis": options.basis,
        "smoothing": options.smoothing,
        "transport": options.transport,
    }


def period_argument(options: Namespace) -> float | list[float] | None:
    """Returns the argument `period` of `pdmp.fit`."""
    periods: list[float] | None = options.period
    return periods[0] if periods is not None and len(periods) == 1 else periods


def _or_named(read: Callable[[str], Any], kind: str, **named: str | None) -> Callable[[str], Any]:
    """Returns a parser of an argument that is a value of this kind or one of the names."""

    def value(text: str) -> Any:
        try:
            return named[text] if text in named else read(text)
        except ValueError:
            names = " or ".join(named)
            raise ArgumentTypeError(f'"{text}" is neither a {kind} nor {names}') from None

    return value
