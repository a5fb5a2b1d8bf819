"""Predictors of an evaluation, and the scores of their forecasts."""

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp.evaluation import (
    PDMP,
    Comparison,
    Components,
    Evaluation,
    Forecast,
    LinearWeights,
    MeanDemonstration,
    MovedGoal,
    NearestDemonstration,
    Predictor,
    RadialWeights,
    Recordings,
    Scores,
    Split,
)
from report.baselines import PeerWeights, ProcessWeights

PROMP = Path(__file__).parent / "data" / "promp.npz"
PREDICTORS: dict[str, Predictor] = {
    "PDMP": PDMP(n_styles=2),
    "mean": MeanDemonstration(),
    "nearest": NearestDemonstration(),
    "moved": MovedGoal(),
    "linear": LinearWeights(Components()),
    "processes": ProcessWeights(Components()),
}


def recorded(
    sampled: np.ndarray, durations: list[float], contexts: Any, kind: Any = "discrete"
) -> Recordings:
    """Returns recordings of movements (M, C, D) whose contexts are numbers."""
    n = sampled.shape[1] - (kind == "discrete")
    demos = [
        pdmp.Demonstration(position, dt=duration / n)
        for position, duration in zip(sampled, durations, strict=True)
    ]
    context = np.reshape(np.asarray(contexts, float), (len(demos), -1))
    labels = (None,) * context.shape[1]
    return Recordings(tuple(demos), context, labels, kind, np.array(durations), sampled)


def arches(heights: Any) -> np.ndarray:
    """Returns planar movements (M, 101, 2) that are linear in their heights."""
    s = np.linspace(0, 1, 101)
    reach, arch = s**3 * (10 - 15 * s + 6 * s**2), 64 * (s * (1 - s)) ** 3
    return np.array([np.column_stack([(1 + h) * reach + h, h * arch]) for h in heights])


HEIGHTS = np.linspace(0, 0.5, 6)


def bumps() -> Recordings:
    """Returns six arches whose durations grow with their heights."""
    return recorded(arches(HEIGHTS), list(np.exp(HEIGHTS)), HEIGHTS)


@pytest.mark.parametrize("name", PREDICTORS)
def test_a_predictor_forecasts_positions_and_duration(name: str) -> None:
    """A forecast for a context (Q,) has (C, D) positions and a duration, all finite."""
    forecast = PREDICTORS[name].fit(bumps())(np.array([0.25]))
    assert forecast.position.shape == (101, 2)
    assert np.isfinite(forecast.position).all()
    assert 1.0 <= forecast.duration <= np.exp(0.5)
    if forecast.variance is not None:
        assert forecast.variance.shape == (101, 2)
        assert (forecast.variance >= -1e-12).all()


def test_mean_demonstration_is_the_same_for_every_context() -> None:
    """Arithmetic mean of positions, geometric of durations, variance of a new movement."""
    sampled = np.array([[[0.0]] * 4, [[1.0]] * 4, [[5.0]] * 4])
    predict = MeanDemonstration().fit(recorded(sampled, [1.0, 2.0, 4.0], [0, 1, 2]))
    near, far = predict(np.array([0.0])), predict(np.array([1e6]))
    np.testing.assert_array_equal(near.position, far.position)
    np.testing.assert_allclose(near.position, 2.0)
    assert near.duration == pytest.approx(2.0)
    assert near.variance is not None
    # (4 + 1 + 9)/(3 - 1), and a third of it for the mean's own error.
    np.testing.assert_allclose(near.variance, 7.0 * 4 / 3)


def test_mean_of_one_demonstration_has_no_variance() -> None:
    """One demonstration has no variance."""
    only = recorded(arches([0.2]), [1.0], [0.2])
    forecast = MeanDemonstration().fit(only)(np.array([0.2]))
    np.testing.assert_array_equal(forecast.position, only.sampled[0])
    assert forecast.variance is None


def test_nearest_is_measured_in_deviations_of_each_context_value() -> None:
    """Distances of contexts do not depend on units."""
    contexts = [[0.0, 0.0], [0.0, 1000.0], [1.0, 0.0], [1.0, 1000.0]]
    four = recorded(arches([0, 1, 2, 3]), [1.0, 2.0, 3.0, 4.0], contexts)
    forecast = NearestDemonstration().fit(four)(np.array([0.9, 300.0]))
    assert forecast.duration == 3.0
    np.testing.assert_array_equal(forecast.position, four.sampled[2])


def test_moved_goal_ends_where_the_context_leads() -> None:
    """Start, goal and log duration are linear in the context; the path is demonstrated."""
    forecast = MovedGoal().fit(bumps())(np.array([0.23]))
    (expected,) = arches([0.23])
    np.testing.assert_allclose(forecast.position[0], expected[0], atol=1e-9)
    np.testing.assert_allclose(forecast.position[-1], expected[-1], atol=1e-3)
    assert forecast.duration == pytest.approx(np.exp(0.23))


@pytest.mark.parametrize("kind", ["discrete", "rhythmic"])
def test_radial_weights_reproduce_movements(kind: Any) -> None:
    """Offset + weights · basis gives each movement; functions of a cycle are periodic."""
    n = 100
    s = np.linspace(0, 2 * np.pi, n, endpoint=kind == "discrete")
    sampled = np.array([np.column_stack([np.sin(s), k * np.cos(2 * s)]) for k in (0.5, 1, 2)])
    weights, offset, basis = RadialWeights()(recorded(sampled, [1.0] * 3, [0, 1, 2], kind))
    assert (weights.shape, offset.shape, basis.shape) == ((3, 40), (200,), (40, 200))
    back = (offset + weights @ basis).reshape(sampled.shape)
    np.testing.assert_allclose(back, sampled, atol=0.02)
    # Normalised functions add up to one at every sample, for each DoF.
    np.testing.assert_allclose(basis.sum(axis=0), 1)
    if kind == "rhythmic":
        first = basis[0].reshape(n, 2)[:, 0]
        np.testing.assert_allclose(first[1:], first[1:][::-1], atol=1e-12)


def test_larger_ridge_gives_smaller_weights() -> None:
    """A larger ridge parameter gives smaller weights."""
    sizes = [
        np.sum(RadialWeights(ridge=ridge)(bumps())[0] ** 2) for ridge in (1e-9, 1e-3, 1.0, 1e3)
    ]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[-1] < 0.1 * sizes[0]


def test_linear_weights_extend_a_linear_family() -> None:
    """For movements that are linear in the context, weights interpolate and extrapolate exactly."""
    predict = LinearWeights(Components(1.0)).fit(bumps())
    for height in (0.23, 0.7):
        np.testing.assert_allclose(
            predict(np.array([height])).position, arches([height])[0], atol=1e-9
        )


def test_processes_follow_nonlinear_families() -> None:
    """For a family that is quadratic in the context, processes are accurate where lines are not."""
    contexts = np.linspace(-1, 1, 11)
    family = recorded(arches(contexts**2), [1.0] * 11, contexts)
    errors = [
        np.abs(
            kind(Components(1.0)).fit(family)(np.array([0.1])).position - arches([0.01])[0]
        ).max()
        for kind in (ProcessWeights, LinearWeights)
    ]
    assert errors[0] < 0.02
    assert errors[1] > 10 * errors[0]


@pytest.fixture(scope="module")
def promp() -> Any:
    """Returns weights and forecasts of movement_primitives."""
    with np.load(PROMP) as archive:
        return SimpleNamespace(**archive)


def test_radial_weights_forecast_as_promps_of_movement_primitives(promp: Any) -> None:
    """Forecasts agree within 1 % with those of a ProMP with other widths."""
    family = recorded(promp.sampled, [1.0] * 6, promp.heights)
    predict = LinearWeights(RadialWeights()).fit(family)
    for height, expected in zip(promp.at, promp.forecasts, strict=True):
        np.testing.assert_allclose(predict(np.array([height])).position, expected, atol=0.01)


def test_weights_of_the_peer_forecast_as_the_peer(
    promp: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Recorded weights and trajectories of movement_primitives give its recorded forecasts."""

    class Replay:
        """Recorded results of movement_primitives for these movements and for unit weights."""

        def __init__(self, n_dims: int, n_weights_per_dim: int) -> None:
            assert (n_dims, n_weights_per_dim) == (2, 20)

        def weights(self, time: np.ndarray, movement: np.ndarray) -> np.ndarray:
            np.testing.assert_allclose(time, np.linspace(0, 1, 101))
            (m,) = np.flatnonzero((promp.sampled == movement).all(axis=(1, 2)))
            return np.asarray(promp.weights[m])

        def trajectory_from_weights(self, time: np.ndarray, weights: np.ndarray) -> np.ndarray:
            return np.tensordot(weights, promp.trajectories, 1)

    monkeypatch.setitem(sys.modules, "movement_primitives", SimpleNamespace())
    monkeypatch.setitem(sys.modules, "movement_primitives.promp", SimpleNamespace(ProMP=Replay))
    family = recorded(promp.sampled, [1.0] * 6, promp.heights)
    weights, offset, basis = PeerWeights()(family)
    back = (offset + weights @ basis).reshape(promp.sampled.shape)
    np.testing.assert_allclose(back, promp.sampled, atol=2e-3)
    predict = LinearWeights(PeerWeights()).fit(family)
    for height, expected in zip(promp.at, promp.forecasts, strict=True):
        np.testing.assert_allclose(predict(np.array([height])).position, expected, atol=1e-6)


def test_missing_peer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing library is named."""
    monkeypatch.setitem(sys.modules, "movement_primitives.promp", None)
    with pytest.raises(ImportError, match="movement_primitives is not installed"):
        PeerWeights()(bumps())


class Shifted:
    """A predictor with a constant error per degree of freedom and a given variance."""

    def __init__(self, step: float, variance: float) -> None:
        self.step = step
        self.variance = variance

    def fit(self, recordings: Recordings) -> Any:
        """Returns the shifted first movement."""
        first = recordings.sampled[0] + self.step
        return lambda _: Forecast(first, 2.0, np.full_like(first, self.variance))


@pytest.fixture(scope="module")
def evaluation() -> Evaluation:
    """Returns an evaluation of two predictors on three equal movements of 1 s."""
    demos, splits = [arches([0.0])[0]] * 3, [([0, 1], [2], "interpolation")] * 2
    tried = {"near": Shifted(0.1, 0.1), "far": Shifted(0.3, 0.01)}
    return pdmp.evaluate(demos, dt=0.01, contexts=[[0], [1], [2]], predictors=tried, splits=splits)


def test_scores_are_arrays_over_splits(evaluation: Evaluation) -> None:
    """Scores are squared distance, relative duration error and coverage of the band, per split."""
    scores = evaluation.score("near")
    assert isinstance(scores, Scores)
    np.testing.assert_allclose(scores.error, [0.02, 0.02])
    np.testing.assert_allclose(scores.duration, [1.0, 1.0])
    np.testing.assert_array_equal(scores.coverage, [1.0, 1.0])
    # 0.3 exceeds 1.645 standard deviations of 0.1.
    np.testing.assert_array_equal(evaluation.score("far").coverage, [0.0, 0.0])


def test_comparison_is_a_difference_of_errors(evaluation: Evaluation) -> None:
    """The comparison of a with b is negative where a is better, and antisymmetric."""
    better, worse = evaluation.compare("near", "far"), evaluation.compare("far", "near")
    assert isinstance(better, Comparison)
    np.testing.assert_allclose(better.differences, [0.02 - 0.18] * 2)
    assert better.mean == pytest.approx(-0.16)
    assert worse.mean == pytest.approx(0.16)
    assert better.standard_error == pytest.approx(0.0, abs=1e-12)


def test_evaluation_has_splits_and_predictors(evaluation: Evaluation) -> None:
    """An evaluation has training and test demonstrations, reaches and predictors."""
    for split in evaluation.splits:
        assert isinstance(split, Split)
        assert (list(split.train), list(split.test)) == ([0, 1], [2])
        assert split.reach == "interpolation"
