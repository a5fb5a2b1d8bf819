"""Demonstrations with contexts, resampled over normalised time, as predictors receive them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pdmp._labels import dof_labels
from pdmp._messages import check_number, check_type, counted, value_error, warn
from pdmp._native import (
    Demonstration,
    Trajectory,
    context_rows,
    from_tangent,
    inspected,
    mean_positions,
    to_tangent,
)

Array: TypeAlias = NDArray[Any]  # of float64
Demos: TypeAlias = (
    Sequence[Demonstration | Trajectory | ArrayLike]
    | Mapping[str, Demonstration | Trajectory | ArrayLike]
    | ArrayLike
)
Kind: TypeAlias = Literal["discrete", "rhythmic"]


@dataclass(frozen=True, eq=False)
class Recordings:
    """M demonstrations of one skill with their contexts.

    Attributes
    ----------
    demos : tuple of Demonstration
        The demonstrations, each at its own rate.
    contexts : ndarray (M, Q)
        Context of each: float64, or objects if some values are labels.
    labels : tuple of Q lists of str or None
        Labels of each context value in alphabetical order; None for a number.
    kind : str
        "discrete", or "rhythmic": each demonstration is one cycle.
    durations : ndarray (M,)
        Durations, or periods [s].
    sampled : ndarray (M, C, D)
        Positions at C samples of normalised time, with both ends if discrete; with rotations, a
        column for each coordinate.
    """

    demos: tuple[Demonstration, ...]
    contexts: Array
    labels: tuple[list[str] | None, ...]
    kind: Kind
    durations: Array
    sampled: Array

    def numbers(self, contexts: Array) -> Array:
        """Returns contexts (B, Q) as numbers (B, F), labels one-hot encoded."""
        columns = []
        for values, labels in zip(contexts.T, self.labels, strict=True):
            if labels is None:
                columns.append(values.astype(float))
            else:
                columns += [(values == label).astype(float) for label in labels]
        return np.column_stack(columns)

    @property
    def n_demos(self) -> int:
        """Number of demonstrations M."""
        return len(self.demos)

    @property
    def n_samples(self) -> int:
        """Number of samples C of a movement."""
        return int(self.sampled.shape[1])

    @property
    def periods(self) -> Array | None:
        """Periods (M,) [s] of rhythmic demonstrations, as `pdmp.fit` takes them."""
        return self.durations if self.kind == "rhythmic" else None

    def interval(self, duration: float) -> float:
        """Returns the sampling interval [s] of a movement of C samples."""
        return duration / (self.n_samples - (self.kind == "discrete"))

    @property
    def rotations(self) -> Mapping[int, str]:
        """First column and order of each unit quaternion among the coordinates."""
        return self.demos[0].rotations

    @property
    def rotation_dofs(self) -> NDArray[np.intp]:
        """Degrees of freedom of the rotations."""
        firsts = [column - r for r, column in enumerate(sorted(self.rotations))]
        return np.array([dof + i for dof in firsts for i in range(3)], np.intp)

    @property
    def names(self) -> list[str]:
        """Names of the degrees of freedom; y0, y1, … without any."""
        return self._labels[0]

    @property
    def units(self) -> list[str]:
        """Units of the degrees of freedom; "" without any."""
        return self._labels[1]

    @property
    def _labels(self) -> tuple[list[str], list[str]]:
        n, demo = self.sampled.shape[2], self.demos[0]
        names, units = demo.names or [f"y{d}" for d in range(n)], demo.units or [""] * n
        return dof_labels(names, units, self.rotations)

    @cached_property
    def mean(self) -> Array:
        """Returns the mean of the movements (C, D), to which rotations are relative."""
        if not self.rotations:
            return np.asarray(self.sampled.mean(axis=0))
        return mean_positions(list(self.sampled), self.rotations)

    @cached_property
    def dofs(self) -> Array:
        """Degrees of freedom (M, C, n_dofs): rotation vectors from the mean [rad], and others."""
        if not self.rotations:
            return self.sampled
        return np.array([self.relative(self.mean, position) for position in self.sampled])

    def relative(self, reference: Array, position: Array) -> Array:
        """Returns degrees of freedom (C, n_dofs), with rotation vectors from a reference."""
        return to_tangent(reference, position, self.rotations) if self.rotations else position

    def positions(self, dofs: Array, rows: slice = slice(None)) -> Array:
        """Returns the positions of degrees of freedom about these samples of the mean."""
        return from_tangent(self.mean[rows], dofs, self.rotations) if self.rotations else dofs

    def __getitem__(self, rows: NDArray[np.intp]) -> Recordings:
        """Returns the recordings of these indices."""
        demos = tuple(self.demos[row] for row in rows)
        contexts, durations = self.contexts[rows], self.durations[rows]
        return Recordings(demos, contexts, self.labels, self.kind, durations, self.sampled[rows])


def recordings(
    demos: Demos,
    contexts: ArrayLike | Sequence[Sequence[float | str]] | None,
    *,
    kind: Kind,
    dt: float | None,
    period: ArrayLike | None,
    n_samples: int,
) -> Recordings:
    """Checks demonstrations and contexts, and resamples each over normalised time."""
    if kind not in ("discrete", "rhythmic"):
        raise value_error(f'kind = {kind!r}: must be "discrete" or "rhythmic"')
    check_number("n_samples", n_samples)
    if n_samples < 4:
        raise value_error(f"n_samples = {n_samples}: must be at least 4")
    if isinstance(demos, (Demonstration, Trajectory)):
        raise ValueError("demos is a single demonstration: put it into a list")
    check_type("demos", demos, Iterable, "a list of demonstrations, or a mapping of names to them")
    values = demos.values() if isinstance(demos, Mapping) else demos
    valid = tuple(_with_interval(demo, dt) for demo in values)  # type: ignore[union-attr]
    if not valid:
        raise ValueError("demos is empty: pass at least two demonstrations")
    for m, demo in enumerate(valid):
        if demo.rotations != valid[0].rotations:
            raise value_error(
                f"demo {m}: rotations {demo.rotations}, expected {valid[0].rotations}"
            )
        if demo.n_dofs != valid[0].n_dofs:
            raise value_error(f"demo {m}: expected {valid[0].n_dofs} DoFs, found {demo.n_dofs}")
    inspected_demos, findings = inspected(list(valid), dt=dt)
    for finding in findings:
        warn(finding)
    valid = tuple(inspected_demos)
    if kind == "discrete" and period is not None:
        raise ValueError("period does not apply to discrete demonstrations: leave it out")
    periods = np.full(len(valid), np.nan) if period is None else np.asarray(period)
    if periods.dtype.kind not in "iuf" or periods.ndim > 1:
        raise ValueError("period must be a number of seconds, or one for each demonstration")
    if periods.ndim and len(periods) != len(valid):
        raise value_error(
            f"period has length {len(periods)}, expected {len(valid)}: one value per demonstration"
        )
    periods = np.broadcast_to(periods, len(valid))
    resampled = [_resample(demo, m, kind, periods[m], n_samples) for m, demo in enumerate(valid)]
    durations, sampled = (np.array(values) for values in zip(*resampled, strict=True))
    conditions = _contexts(valid, contexts)
    labels = tuple(_labels(q, values) for q, values in enumerate(conditions.T))
    return Recordings(valid, conditions, labels, kind, durations, sampled)


def _with_interval(demo: Demonstration | Trajectory | ArrayLike, dt: float | None) -> Demonstration:
    """Returns a demonstration with the sampling interval `dt` if it has none."""
    if isinstance(demo, Trajectory):
        return Demonstration(demo)
    if not isinstance(demo, Demonstration):
        return Demonstration(demo, dt=dt)
    if demo.time is not None or dt is None:
        return demo
    (position,), rest = demo.__getnewargs_ex__()
    return Demonstration(position, **rest | {"dt": dt})


def _resample(
    demo: Demonstration, m: int, kind: Kind, period: float, n_samples: int
) -> tuple[float, Array]:
    """Returns the duration [s] and the linearly interpolated positions (C, D)."""
    if demo.time is None:
        raise value_error(f"demo {m}: dt is missing: pass the sampling interval in seconds")
    time = demo.time - demo.time[0]
    duration, cycle = float(time[-1]), None
    if kind == "rhythmic":
        if np.isnan(period) and demo.dt is None:
            raise value_error(f"demo {m}: a time-stamped cycle: pass period= in seconds")
        cycle = float((demo.dt or 0) * demo.n_samples if np.isnan(period) else period)
        if cycle <= duration:
            raise value_error(
                f"demo {m}: period = {cycle:g}: must exceed the last time stamp, {duration:g} s"
            )
        duration = cycle
    grid = np.linspace(0, duration, n_samples, endpoint=kind == "discrete")
    position = demo.position
    columns = [np.interp(grid, time, column, period=cycle) for column in position.T]
    for column in demo.rotations:
        four = slice(column, column + 4)
        columns[four] = _interpolate_rotation(grid, time, position[:, four], cycle)
    return duration, np.transpose(columns)


def _interpolate_rotation(grid: Array, time: Array, q: Array, cycle: float | None) -> list[Array]:
    """Returns the components (4, C) of unit quaternions of continuous signs, interpolated."""
    if cycle is not None:
        # The sign of a quaternion may change over the cycle.
        closing = q[:1] if q[0] @ q[-1] >= 0 else -q[:1]
        time, q = np.append(time, cycle), np.concatenate([q, closing])
    components = np.array([np.interp(grid, time, component) for component in q.T])
    return list(components / np.linalg.norm(components, axis=0))


def _contexts(demos: Sequence[Demonstration], contexts: object) -> Array:
    """Returns the checked contexts (M, Q)."""
    values: Any = contexts
    if contexts is None:
        values = [demo.context for demo in demos]
        for m, context in enumerate(values):
            if context is None:
                raise value_error(f"demo {m} has no context: pass contexts=")
            if len(context) != len(values[0]):
                raise value_error(
                    f"demo {m}: context has length {len(context)}, expected {len(values[0])}"
                )
    rows = context_rows(values)
    if len({len(row) for row in rows}) > 1:
        raise ValueError("contexts differ in length: pass the same values for every demonstration")
    has_labels = any(isinstance(value, str) for row in rows for value in row)
    # As an array of texts, numpy would convert numbers beside labels.
    array = np.array(rows, object if has_labels else float)
    if len(array) != len(demos):
        raise value_error(
            f"contexts has length {len(array)}, expected {len(demos)}: one value per demonstration"
        )
    finite = [[isinstance(value, str) or np.isfinite(value) for value in row] for row in array]
    for m, q in np.argwhere(~np.array(finite))[:1]:
        raise value_error(f"contexts[{m}, {q}] = {array[m, q]}: must be finite: leave the demo out")
    return array


def _labels(q: int, values: Array) -> list[str] | None:
    """Returns the labels of one context value, or None for numbers."""
    labels = sorted({value for value in values if isinstance(value, str)})
    if not labels:
        return None
    if numbers := sum(not isinstance(value, str) for value in values):
        raise value_error(
            f"contexts[:, {q}] holds {counted(len(values) - numbers, 'label')} and "
            f"{counted(numbers, 'number')}: "
            "write all of them as labels, or all as numbers"
        )
    return labels
