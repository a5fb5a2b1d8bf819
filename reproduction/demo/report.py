"""Tables of the report, in Markdown."""

from collections.abc import Mapping, Sequence

import numpy as np

import pdmp
from pdmp._markdown import markdown_table
from reproduction.demo.loop import Run
from reproduction.metrics import reproduction_error


def singular_value_table(model: pdmp.Model) -> str:
    """Returns the share of each singular value in their sum, up to two beyond J."""
    shares = model.singular_values / model.singular_values.sum()
    sums = shares.cumsum()
    return markdown_table(
        ["singular value", "share", "sum"],
        ([k + 1, f"{shares[k]:.1%}", f"{sums[k]:.1%}"] for k in range(model.n_styles + 2)),
    )


def error_table(
    models: Sequence[pdmp.Model],
    demos: Sequence[pdmp.Demonstration],
    members: Mapping[str, Sequence[int]],
) -> str:
    """Returns the mean reproduction error of each shape, for each model."""
    return markdown_table(
        ["shape", *(f"error, J = {model.n_styles}" for model in models)],
        (
            [
                shape,
                *(
                    f"{np.mean([reproduction_error(model, demos[m], m) for m in rows]):.1e}"
                    for model in models
                ),
            ]
            for shape, rows in members.items()
        ),
    )


def loop_table(runs: Mapping[str, Run]) -> str:
    """Returns the final distance to the goal and the tick times of each loop."""
    return markdown_table(
        ["control loop at 1 kHz", "left to the goal", "mean tick", "worst tick"],
        (
            [name, f"{run.left:.1e} mm", f"{run.ticks.mean():.2f} µs", f"{run.ticks.max():.1f} µs"]
            for name, run in runs.items()
        ),
    )


def time_table(times: Mapping[str, float]) -> str:
    """Returns the duration of each step."""
    return markdown_table(
        ["part", "time"], ([name, f"{1e3 * time:.1f} ms"] for name, time in times.items())
    )
