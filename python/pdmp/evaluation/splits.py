"""Splits of demonstrations into training and test sets."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pdmp._messages import value_error
from pdmp.evaluation.recordings import Array

Reach: TypeAlias = Literal["interpolation", "extrapolation"]
Rows: TypeAlias = NDArray[np.intp]
MAX_STEPS = 2000  # of the search for a convex combination
TOLERANCE = 1e-6  # distance from the hull, in ranges of the contexts, that counts as inside


class Split(NamedTuple):
    """Training and test demonstrations.

    Attributes
    ----------
    train, test : ndarray of int
        Indices of the demonstrations.
    reach : str
        "interpolation" if the contexts of `test` lie in the convex hull of those of `train`,
        otherwise "extrapolation".
    """

    train: Rows
    test: Rows
    reach: Reach


def held_out(contexts: Array, max_folds: int) -> list[Split]:
    """Returns splits that hold out each condition, or each of `max_folds` folds of neighbours.

    Contexts outside the convex hull of the training contexts are extrapolation. A fold with
    conditions of both reaches gives two splits.
    """
    conditions, member = np.unique(contexts, axis=0, return_inverse=True)
    member = member.reshape(-1)
    if len(conditions) < 2:
        raise value_error(
            f"contexts: one condition in {len(contexts)} demonstrations: "
            "at least 2 are needed to hold one out"
        )
    if max_folds < 2:
        raise value_error(f"max_folds = {max_folds}: must be at least 2")
    splits = []
    for fold in neighbours(conditions, max_folds):
        training = np.delete(conditions, fold, axis=0)
        train = np.flatnonzero(~np.isin(member, fold))
        inside = np.array([within_hull(conditions[row], training) for row in fold])
        for rows, reach in ((fold[inside], "interpolation"), (fold[~inside], "extrapolation")):
            if rows.size:
                splits.append(Split(train, np.flatnonzero(np.isin(member, rows)), reach))  # type: ignore[arg-type]
    return splits


def neighbours(conditions: Array, max_folds: int) -> list[Rows]:
    """Partitions conditions (K, Q) into at most `max_folds` folds of neighbours.

    The fold with the most conditions is halved along its longest side until there are enough.
    """
    unit = _unit(conditions)
    folds: list[Rows] = [np.arange(len(conditions))]
    while len(folds) < min(max_folds, len(conditions)):
        largest = max(range(len(folds)), key=lambda k: len(folds[k]))
        fold = folds.pop(largest)
        side = np.argmax(np.ptp(unit[fold], axis=0))
        ordered = fold[np.argsort(unit[fold, side], kind="stable")]
        folds[largest:largest] = [np.sort(half) for half in np.array_split(ordered, 2)]
    return folds


def within_hull(point: Array, points: Array) -> bool:
    """Returns True if a point (Q,) is a convex combination of others (K, Q).

    Pairwise Frank-Wolfe steps minimise the distance of the combination from the point: each moves
    weight from the active point with the largest projection on the residual to the point with the
    smallest. A separating plane ends the search. A point for which `MAX_STEPS` find neither, which
    is near the surface, counts as inside.
    """
    spread = np.ptp(points, axis=0)
    offset = (points - point) / np.where(spread > 0, spread, 1)
    weights = np.zeros(len(points))
    weights[np.argmin((offset**2).sum(axis=1))] = 1
    for _ in range(MAX_STEPS):
        residual = weights @ offset
        if residual @ residual <= TOLERANCE**2:
            return True
        projection = offset @ residual
        target = np.argmin(projection)
        source = np.argmax(np.where(weights > 0, projection, -np.inf))
        if projection[target] > 0:
            return False
        direction = offset[target] - offset[source]
        step = min(weights[source], -(residual @ direction) / (direction @ direction))
        weights[target] += step
        weights[source] -= step
    return True


def checked(splits: Iterable[Sequence[object]], n_demos: int) -> list[Split]:
    """Returns the checked splits of a user, each (train, test, reach)."""
    valid = []
    for k, split in enumerate(splits):
        if (
            not isinstance(split, Sequence)
            or len(split) != 3
            or split[2] not in ("interpolation", "extrapolation")
        ):
            raise value_error(
                f'splits[{k}]: must be (train, test, "interpolation" or "extrapolation")'
            )
        rows = []
        for name, values in zip(("train", "test"), split, strict=False):
            indices = np.asarray(values)
            if indices.ndim != 1 or indices.size == 0 or indices.dtype.kind not in "iu":
                raise value_error(f"splits[{k}]: {name} must be one or more indices")
            for index in indices[(indices < 0) | (indices >= n_demos)]:
                raise value_error(
                    f"splits[{k}]: {name} index {index} must lie between 0 and {n_demos - 1}"
                )
            rows.append(indices.astype(np.intp))
        if shared := sorted(set(rows[0].tolist()) & set(rows[1].tolist())):
            raise value_error(f"splits[{k}]: demonstration {shared[0]} is in train and in test")
        valid.append(Split(rows[0], rows[1], split[2]))
    if not valid:
        raise ValueError("splits is empty: pass at least one")
    return valid


def _unit(conditions: Array) -> Array:
    """Returns conditions divided by their ranges."""
    spread = np.ptp(conditions, axis=0)
    return conditions / np.where(spread > 0, spread, 1)
