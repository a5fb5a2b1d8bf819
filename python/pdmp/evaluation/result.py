"""Results of an evaluation: errors per split, their means, and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan, sqrt
from typing import NamedTuple

import numpy as np

from pdmp._markdown import markdown_table
from pdmp._messages import printable, value_error
from pdmp.evaluation.predictors import BAND, HALF_WIDTH, Forecast, Predictor
from pdmp.evaluation.recordings import Array, Recordings
from pdmp.evaluation.splits import Reach, Split

REFERENCE = "mean demonstration"
HEADER = ("predictor", "E", "± sd", "E / mean's", "± se", f"in {BAND:.0%} band", "duration off")
ROTATION_HEADER = ("distance", "angle [rad]")


class Scores(NamedTuple):
    """Scores of one predictor: means over the test demonstrations of each of S splits.

    Attributes
    ----------
    error : ndarray (S,)
        Error E, in the squared unit of the positions.
    duration : ndarray (S,)
        Relative error of the duration, |T̂ - T| / T.
    coverage : ndarray (S,)
        Share of the positions inside the 90 % band; NaN if no variance is predicted.
    distance : ndarray (S,)
        Root mean square distance over the degrees of freedom that are no part of a rotation, in
        their unit.
    angle : ndarray (S,)
        Root mean square geodesic distance of the orientations [rad]; NaN without rotations.
    """

    error: Array
    duration: Array
    coverage: Array
    distance: Array
    angle: Array


class Summary(NamedTuple):
    """Means of one predictor over n splits.

    Attributes
    ----------
    n : int
        Number of splits.
    error, deviation, standard_error : float
        Mean of E, its standard deviation and its standard error; the last two NaN for one split.
    relative, relative_error : float
        Mean of E over that of the mean demonstration, and its standard error.
    coverage : float
        Share of the positions inside the 90 % band; NaN if no variance is predicted.
    duration : float
        Relative error of the duration, |T̂ - T| / T.
    distance, angle : float
        Root mean squares of the distance without rotations, and of the angle of the rotations
        [rad].
    """

    n: int
    error: float
    deviation: float
    standard_error: float
    relative: float
    relative_error: float
    coverage: float
    duration: float
    distance: float
    angle: float


class Comparison(NamedTuple):
    """Differences of E between two predictors on the same splits.

    Attributes
    ----------
    differences : ndarray (S,)
        Difference for each split.
    mean, standard_error : float
        Mean of the differences and its standard error.
    """

    differences: Array
    mean: float
    standard_error: float


@dataclass(frozen=True, eq=False, repr=False)
class Evaluation:
    """Errors of several predictors on held-out demonstrations.

    Attributes
    ----------
    recordings : Recordings
        The demonstrations over normalised time.
    splits : tuple of Split
        Training and test demonstrations. A fold with conditions of both reaches gives two splits.
    predictors : dict of str to Predictor
        Predictors by name.
    forecasts : dict of str to list of list of Forecast
        Forecasts by predictor, split and held-out demonstration.
    scores : dict of str to Scores
        Scores of each predictor.
    skipped : dict of str to str
        Predictors that raised an ImportError, and its text.
    """

    recordings: Recordings
    splits: tuple[Split, ...]
    predictors: dict[str, Predictor]
    forecasts: dict[str, list[list[Forecast]]]
    scores: dict[str, Scores]
    skipped: dict[str, str]

    def score(self, predictor: str) -> Scores:
        """Returns the scores of one predictor."""
        if predictor not in self.scores:
            raise value_error(f"predictor = '{predictor}': must be one of {', '.join(self.scores)}")
        return self.scores[predictor]

    def summary(self, predictor: str, reach: Reach | None = None) -> Summary:
        """Returns the means of one predictor over the splits of one reach, or over all splits."""
        rows = self._rows(reach)
        error, duration, coverage, distance, angle = (
            values[rows] for values in self.score(predictor)
        )
        reference = self.scores[REFERENCE].error[rows]
        level = float(reference.mean()) or nan
        relative = float(error.mean()) / level
        return Summary(
            len(error),
            float(error.mean()),
            _deviation(error),
            _standard_error(error),
            relative,
            # Standard error of a ratio of means, to first order.
            _standard_error(error - relative * reference) / level,
            float(coverage.mean()),
            float(duration.mean()),
            sqrt(np.mean(distance**2)),
            sqrt(np.mean(angle**2)),
        )

    def compare(self, a: str, b: str, reach: Reach | None = None) -> Comparison:
        """Returns the differences E(a) - E(b); negative where `a` is better."""
        rows = self._rows(reach)
        differences = (self.score(a).error - self.score(b).error)[rows]
        return Comparison(differences, float(differences.mean()), _standard_error(differences))

    def reaches(self) -> list[Reach]:
        """Returns the reaches of the splits."""
        present = {split.reach for split in self.splits}
        return [reach for reach in ("interpolation", "extrapolation") if reach in present]

    @property
    def header(self) -> tuple[str, ...]:
        """Titles of the columns of `table`."""
        return HEADER + (ROTATION_HEADER if self.recordings.rotations else ())

    def table(self, reach: Reach) -> list[list[str]]:
        """Returns a row per predictor over the splits of one reach; `header` has the columns."""
        rows = []
        for name in self.scores:
            mean = self.summary(name, reach)
            errors = (mean.error, mean.deviation, mean.relative, mean.relative_error)
            shares = (mean.coverage, mean.duration)
            apart = (mean.distance, mean.angle) if self.recordings.rotations else ()
            numbers = [*map(_number, errors), *map(_percent, shares), *map(_number, apart)]
            rows.append([printable(name), *numbers])
        return rows

    def markdown(self) -> str:
        """Returns the tables in Markdown."""
        lines = []
        for reach in self.reaches():
            lines += [
                f"**{self._title(reach)}**",
                "",
                markdown_table(self.header, self.table(reach)),
                "",
            ]
        return "\n".join([*lines, *self._notes()])

    def __repr__(self) -> str:
        """Returns the tables as text."""
        lines = []
        for reach in self.reaches():
            cells = [list(map(_plain, row)) for row in (self.header, *self.table(reach))]
            widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
            lines.append(self._title(reach))
            for first, *others in cells:
                padded = [f"{o:>{w}}" for o, w in zip(others, widths[1:], strict=True)]
                lines.append("  ".join([f"{first:<{widths[0]}}", *padded]))
            lines.append("")
        return "\n".join([*lines, *self._notes()]).rstrip()

    def _title(self, reach: Reach) -> str:
        rows = self._rows(reach)
        n_held_out = sum(len(self.splits[row].test) for row in rows)
        return f"{reach}: {len(rows)} folds, {n_held_out} demonstrations"

    def _notes(self) -> list[str]:
        return [
            f"left out: {printable(name)}: {printable(reason)}"
            for name, reason in self.skipped.items()
        ]

    def _rows(self, reach: Reach | None) -> list[int]:
        rows = [k for k, split in enumerate(self.splits) if reach in (None, split.reach)]
        if not rows:
            raise value_error(f'reach = "{reach}": no split has this reach')
        return rows


def score(
    recordings: Recordings, splits: Sequence[Split], forecasts: Sequence[Sequence[Forecast]]
) -> Scores:
    """Returns the scores of forecasts of the held-out demonstrations."""
    rows = []
    turning = recordings.rotation_dofs
    for split, predicted in zip(splits, forecasts, strict=True):
        each = []
        for m, forecast in zip(split.test, predicted, strict=True):
            recorded = recordings.relative(forecast.position, recordings.sampled[m])
            error = recorded - recordings.relative(forecast.position, forecast.position)
            coverage = nan
            if forecast.variance is not None:
                coverage = float(np.mean(error**2 <= HALF_WIDTH**2 * forecast.variance))
            duration = abs(forecast.duration / recordings.durations[m] - 1)
            squares = np.mean(error**2, axis=0)
            angle = np.sum(squares[turning]) / max(len(recordings.rotations), 1)
            distance = np.sum(np.delete(squares, turning))
            each.append((np.sum(error**2, axis=1).mean(), duration, coverage, distance, angle))
        rows.append(np.mean(each, axis=0))
    error, duration, coverage, distance, angle = np.transpose(rows)
    angles = np.sqrt(angle) if turning.size else np.full(len(rows), nan)
    return Scores(error, duration, coverage, np.sqrt(distance), angles)


def _deviation(values: Array) -> float:
    return float(values.std(ddof=1)) if len(values) > 1 else nan


def _standard_error(values: Array) -> float:
    return _deviation(values) / sqrt(len(values))


def _plain(cell: str) -> str:
    """Returns a cell in ASCII, for consoles with other encodings."""
    return cell.replace("±", "+-").replace("–", "-")


def _number(value: float) -> str:
    return "–" if np.isnan(value) else f"{value:.3g}"


def _percent(value: float) -> str:
    return "–" if np.isnan(value) else f"{value:.0%}"
