"""Which demonstrations are learnt from, and which are held out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pdmp._messages import value_error
from pdmp.evaluation.recordings import Array

Reach: TypeAlias = Literal["interpolation", "extrapolation"]
Rows: TypeAlias = NDArray[np.intp]
STEPS = 2000  # of the search for a convex combination
NEAR = 1e-6  # distance, in ranges of the contexts, at which a context counts as inside


class Split(NamedTuple):
    """Demonstrations to learn from and to predict.

    Attributes
    ----------
    train, test : ndarray of int
        Their indices.
    reach : str
        "interpolation" or "extrapolation": where the contexts of `test` lie.
    """

    train: Rows
    test: Rows
    reach: Reach


def held_out(contexts: Array, max_folds: int) -> list[Split]:
    """Holds out each condition in turn, or, where they are many, each fold of neighbours.

    What lies outside the convex hull of the contexts learnt from is extrapolation. A fold with
    conditions of both sorts gives two splits.
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
        learnt = np.delete(conditions, fold, axis=0)
        train = np.flatnonzero(~np.isin(member, fold))
        inside = np.array([within_hull(conditions[row], learnt) for row in fold])
        for rows, reach in ((fold[inside], "interpolation"), (fold[~inside], "extrapolation")):
            if rows.size:
                splits.append(Split(train, np.flatnonzero(np.isin(member, rows)), reach))  # type: ignore[arg-type]
    return splits


def neighbours(conditions: Array, max_folds: int) -> list[Rows]:
    """Parts conditions (K, Q) into at most so many folds of neighbours.

    The fold of most conditions is halved along its longest side, until there are enough.
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
    """Returns whether a point (Q,) is a convex combination of others (K, Q).

    Weight moves between two points at a time, from the one farthest against the way to the one
    farthest along it, until the combination is there or a plane parts it from the point. One so
    near the surface that neither is found counts as inside.
    """
    spread = np.ptp(points, axis=0)
    offset = (points - point) / np.where(spread > 0, spread, 1)
    weights = np.zeros(len(points))
    weights[np.argmin((offset**2).sum(axis=1))] = 1
    for _ in range(STEPS):
        left = weights @ offset
        if left @ left <= NEAR**2:
            return True
        along = offset @ left
        to, source = np.argmin(along), np.argmax(np.where(weights > 0, along, -np.inf))
        if along[to] > 0:
            return False
        way = offset[to] - offset[source]
        step = min(weights[source], -(left @ way) / (way @ way))
        weights[to] += step
        weights[source] -= step
    return True


def checked(splits: Iterable[Sequence[object]], n_demos: int) -> list[Split]:
    """Returns a user's splits, each (train, test, "interpolation" or "extrapolation")."""
    found = []
    for k, split in enumerate(splits):
        if len(split) != 3 or split[2] not in ("interpolation", "extrapolation"):
            raise value_error(
                f'splits[{k}]: must be (train, test, "interpolation" or "extrapolation")'
            )
        rows = []
        for name, given in zip(("train", "test"), split, strict=False):
            indices = np.asarray(given)
            if indices.ndim != 1 or indices.size == 0 or indices.dtype.kind not in "iu":
                raise value_error(f"splits[{k}]: {name} must be one or more indices")
            for index in indices[(indices < 0) | (indices >= n_demos)]:
                raise value_error(
                    f"splits[{k}]: {name} index {index} must lie between 0 and {n_demos - 1}"
                )
            rows.append(indices.astype(np.intp))
        if both := sorted(set(rows[0].tolist()) & set(rows[1].tolist())):
            raise value_error(f"splits[{k}]: demonstration {both[0]} is in train and in test")
        found.append(Split(rows[0], rows[1], split[2]))
    if not found:
        raise ValueError("splits is empty: pass at least one")
    return found


def _unit(conditions: Array) -> Array:
    """Returns conditions over their ranges."""
    spread = np.ptp(conditions, axis=0)
    return conditions / np.where(spread > 0, spread, 1)
