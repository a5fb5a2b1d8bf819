"""Prints the contents of a model file.

example: pdmp info reach.safetensors
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence

import numpy as np

import pdmp
from pdmp._labels import join_label
from pdmp._messages import printable
from pdmp.cli.console import say
from pdmp.cli.options import add_model
from pdmp.cli.streams import inputs

MAX_VALUES = 40  # singular values to print


def arguments(parser: ArgumentParser) -> None:
    """Declares the arguments of the command."""
    add_model(parser)


def run(options: Namespace) -> None:
    """Loads a model and prints its description."""
    with inputs([options.model]) as (path,):
        model = pdmp.load(path)
    constants = f"alpha_z {model.alpha_z:g}, beta_z {model.beta_z:g}"
    if model.alpha_x is not None:
        constants += f", alpha_x {model.alpha_x:g}"
    if model.mu is not None:
        constants += f", mu {model.mu:g}"
    lines = {
        "kind": model.kind,
        "demonstrations": f"{model.n_demos}, nominal {model.nominal}",
        "durations": f"{model.durations.min():g} to {model.durations.max():g} s",
        "DoFs": f"{model.n_dofs}: {', '.join(map(join_label, model.names, model.units))}",
        "styles": f"{model.n_styles}; truncation error {model.truncation_error:.1%} of the targets",
        "singular values": _several(model.singular_values),
        "noise": _noise(model),
        "regression": f"{model.regression}; table error {model.table_error:.1e}",
        "time": f"tau {model.tau:g} s",
        "constants": constants,
    }
    if model.rotations:
        orders = [f"{model.coordinate_names[c]} {order}" for c, order in model.rotations.items()]
        lines["rotations"] = f"{', '.join(orders)}; velocities in the {model.rotation_frame} frame"
    if model.kind == "rhythmic":
        lines["time"] = f"period {2 * np.pi * model.tau:g} s (tau {model.tau:g} s)"
    if len(model.breaks) > 2:
        lines["segments"] = f"{len(model.breaks) - 1}"
    if model.contexts is not None:
        columns = zip(*model.contexts, strict=True)
        names = model.context_names or [""] * len(model.contexts[0])
        extents = zip(names, map(_extent, columns), strict=True)
        lines["contexts"] = ", ".join(f"{name} {extent}".strip() for name, extent in extents)
        lines["map"] = str(model.map)
    for name, text in lines.items():
        say(f"{name:<16}{printable(text)}")


def _noise(model: pdmp.Model) -> str:
    """Returns the standard deviation of the measurement noise and the cut-off, per DoF, as text."""
    labels = map(join_label, model.names, model.units)
    noisy = zip(labels, model.noise, model.cut_offs, strict=True)
    levels = [
        f"{label}: {level:.2g}, smoothed at {hz:.3g} Hz" for label, level, hz in noisy if level
    ]
    return "; ".join(levels) or "none found"


def _extent(values: Sequence[float | str]) -> str:
    """Returns the labels, or the range of the numbers, of one column of the contexts."""
    labels = sorted({value for value in values if isinstance(value, str)})
    numbers = [value for value in values if not isinstance(value, str)]
    return " ".join(labels) or f"{min(numbers):g} to {max(numbers):g}"


def _several(values: np.ndarray) -> str:
    """Returns up to `MAX_VALUES` numbers as text."""
    n_omitted = len(values) - MAX_VALUES
    more = f" and {n_omitted} more" if n_omitted > 0 else ""
    return " ".join(f"{value:.4g}" for value in values[:MAX_VALUES]) + more
