"""Predictions on a grid of contexts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from math import prod
from typing import Any

import numpy as np

from pdmp._labels import split_label
from pdmp._native import Conditions, Model
from pdmp.explorer._packing import packed

MAX_TABLE_BYTES = 240_000
MAX_VALUES = 201
"""Values of a context column: about one per pixel of a slider."""
MIN_VALUES = 3


def context_table(
    model: Model, tau_of: Callable[[Model, Conditions], float]
) -> tuple[dict[str, Any] | None, str]:
    """Returns the columns and the table of predictions, or None; and a note for the reader."""
    if model.contexts is None:
        return None, ""
    rows = [list(context) for context in model.contexts]
    n_columns = len(rows[0])
    names = model.context_names or [f"context {q + 1}" for q in range(n_columns)]
    columns = [[row[q] for row in rows] for q in range(n_columns)]
    labels = [any(isinstance(value, str) for value in column) for column in columns]
    n_positions = 1 if model.kind == "rhythmic" else 2
    width = model.n_styles + n_positions * model.n_coordinates + 1
    n_rows = MAX_TABLE_BYTES // (8 * width)
    sets = [
        sorted(set(column), key=str) if label else []
        for column, label in zip(columns, labels, strict=True)
    ]
    n_labels = prod(len(values) for values in sets if values)
    n_numbers = labels.count(False)
    per_number = int((n_rows / n_labels) ** (1 / max(n_numbers, 1)) + 1e-9)
    if n_labels > n_rows or (n_numbers and per_number < MIN_VALUES):
        return None, (
            f"Contexts of {n_columns} columns have too many combinations for this page: "
            "select a demonstration instead."
        )
    values: list[list[Any]] = [
        own or _grid(column, min(per_number, MAX_VALUES))
        for own, column in zip(sets, columns, strict=True)
    ]
    table = [_row(model, model.predict(list(c)).conditions, tau_of) for c in product(*values)]
    described = [
        {"name": name, "unit": split_label(name)[1], "values": own}
        for name, own in zip(names, values, strict=True)
    ]
    return {"columns": described, "table": packed(np.array(table))}, (
        "Contexts step over predictions for the demonstrated range."
    )


def _grid(column: Sequence[Any], n: int) -> list[float]:
    """Returns n equidistant numbers over the range of a column, or its single value."""
    low, high = float(min(column)), float(max(column))
    return np.linspace(low, high, n).tolist() if high > low else [low]


def _row(
    model: Model, conditions: Conditions, tau_of: Callable[[Model, Conditions], float]
) -> list[float]:
    """Returns style, goal and start or anchor, and τ."""
    if model.kind == "discrete":
        positions = [conditions.goal, conditions.start]
    else:
        positions = [conditions.anchor]
    vectors = [vector for vector in (conditions.style, *positions) if vector is not None]
    return [*(float(x) for vector in vectors for x in vector), tau_of(model, conditions)]
