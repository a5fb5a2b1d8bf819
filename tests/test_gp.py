"""Gaussian processes, against scikit-learn, dense matrices in numpy and values of tinygp."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import pdmp

process = pytest.importorskip("sklearn.gaussian_process")
kernels = process.kernels

TINYGP = Path(__file__).parent / "data" / "tinygp.npz"
MANY = settings(max_examples=200)
THEIRS = {
    "matern32": lambda length, **bounds: kernels.Matern(length, nu=1.5, **bounds),
    "matern52": lambda length, **bounds: kernels.Matern(length, nu=2.5, **bounds),
}
TEXTBOOK = {
    "matern32": lambda x: (1 + np.sqrt(3) * x) * np.exp(-np.sqrt(3) * x),
    "matern52": lambda x: (1 + np.sqrt(5) * x + 5 / 3 * x**2) * np.exp(-np.sqrt(5) * x),
}


class Problem(NamedTuple):
    """Data of a process, and inputs of its predictions."""

    length: float
    noise: float
    u: np.ndarray
    f: np.ndarray
    at: np.ndarray

    def regress(self, kernel: Any, **options: Any) -> pdmp.GPRegression:
        """Returns the process conditioned on the data."""
        return pdmp.GP(kernel, self.length, self.noise).regress(self.u, self.f, **options)


@st.composite
def problems(draw: st.DrawFn, extent: float | None = None) -> Problem:
    """Returns uneven, partly repeated inputs with outputs of any unit."""
    gaps = draw(st.lists(st.just(0.0) | st.floats(0.0, 1.0), min_size=2, max_size=30))
    u = np.cumsum(gaps)
    assume(u[-1] >= 0.1)
    u *= (extent or 10 ** draw(st.floats(-3, 3))) / u[-1]
    shape = (len(u), draw(st.integers(1, 5)))
    f = draw(arrays.arrays(np.float64, shape, elements=st.floats(-1, 1, width=16)))
    assume(np.abs(f).max() >= 0.1)
    return Problem(
        length=u[-1] * 10 ** draw(st.floats(-2, 0.5)),
        noise=10 ** draw(st.floats(-5, 0)),
        u=u,
        f=f * 10 ** draw(st.floats(-6, 6)),
        at=np.append(u[-1] * np.linspace(-0.3, 1.3, 17), u),
    )


def assert_agrees(
    regression: pdmp.GPRegression,
    problem: Problem,
    *,
    signal: float,
    mean: np.ndarray,
    deviation: np.ndarray,
    log_likelihood: float,
) -> None:
    """Asserts agreement to 1e-8 of the size of outputs, signal and likelihood."""
    found, variance = regression.predict(problem.at)
    assert regression.noise == problem.noise
    assert regression.signal_variance == pytest.approx(signal, rel=1e-8)
    np.testing.assert_allclose(found, mean, rtol=0, atol=1e-8 * np.abs(problem.f).max())
    np.testing.assert_allclose(np.sqrt(variance), deviation, rtol=0, atol=1e-8 * np.sqrt(signal))
    assert regression.log_likelihood == pytest.approx(log_likelihood, rel=1e-8, abs=1e-8)


def likeliest_signal(k: np.ndarray, f: np.ndarray) -> float:
    """Returns Σ fᵀK⁻¹f/(CP)."""
    return float(np.sum(f * np.linalg.solve(k, f)) / f.size)


@pytest.mark.parametrize("kernel", THEIRS)
@MANY
@given(problem=problems())
def test_processes_are_those_of_scikit_learn(kernel: str, problem: Problem) -> None:
    """Mean, deviation and likelihood agree for any inputs, with signal variance Σ fᵀK⁻¹f/(CP)."""
    unit = THEIRS[kernel](problem.length)
    u, noise = problem.u[:, None], problem.noise
    signal = likeliest_signal(unit(u) + noise * np.eye(len(u)), problem.f)
    theirs = process.GaussianProcessRegressor(
        kernels.ConstantKernel(signal) * unit, alpha=noise * signal, optimizer=None
    ).fit(u, problem.f)
    mean, deviation = theirs.predict(problem.at[:, None], return_std=True)
    assert_agrees(
        problem.regress(kernel),
        problem,
        signal=signal,
        mean=mean.reshape(len(problem.at), -1),
        deviation=deviation.reshape(len(problem.at), -1),
        log_likelihood=theirs.log_marginal_likelihood_value_,
    )


def wrapped(kernel: str, length: float, r: np.ndarray) -> np.ndarray:
    """Returns Σₙ k(r + 2πn)/Σₙ k(2πn)."""
    turns = 2 * np.pi * np.arange(-120, 121)
    images = TEXTBOOK[kernel](np.abs(np.append(r.ravel(), 0.0)[:, None] + turns) / length)
    *sums, norm = images.sum(axis=1)
    return np.reshape(sums, r.shape) / norm


@pytest.mark.parametrize("kernel", TEXTBOOK)
@MANY
@given(problem=problems(extent=6.0))
def test_periodic_processes_have_the_wrapped_kernel(kernel: str, problem: Problem) -> None:
    """On the circle, processes have the covariance Σₙ k(r + 2πn)/Σₙ k(2πn)."""
    length, noise, u, f, at = problem
    k = wrapped(kernel, length, u[:, None] - u) + noise * np.eye(len(u))
    signal = likeliest_signal(k, f)
    cross = wrapped(kernel, length, at[:, None] - u)
    known = np.sum(cross * np.linalg.solve(k, cross.T).T, axis=1)
    log_determinant = np.linalg.slogdet(2 * np.pi * signal * k).logabsdet
    assert_agrees(
        problem.regress(kernel, periodic=True),
        problem,
        signal=signal,
        mean=cross @ np.linalg.solve(k, f),
        deviation=np.sqrt(signal * (1 - known))[:, None] * np.ones(f.shape[1]),
        log_likelihood=-0.5 * (f.size + f.shape[1] * log_determinant),
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kernel", ["matern32", "matern52"])
def test_matern_processes_are_those_of_tinygp(kernel: str, seed: int) -> None:
    """Another linear-time algorithm gives the same mean, deviation and likelihood."""
    with np.load(TINYGP) as archive:
        problem = Problem(
            length=float(archive[f"{seed}/length"]),
            noise=float(archive[f"{seed}/noise"]),
            **{name: archive[f"{seed}/{name}"] for name in ("u", "f", "at")},
        )
        theirs = {
            name: archive[f"{seed}/{kernel}/{name}"]
            for name in ("signal", "mean", "deviation", "log_likelihood")
        }
    assert_agrees(problem.regress(kernel), problem, **theirs)


@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("noise", "true", "most"),
    [(None, 1e-7, 0.05), (None, 1e-2, 0.05), (1e-8, 1e-8, 1e-3), (1e-2, 1e-2, 1e-3)],
)
@pytest.mark.parametrize("kernel", THEIRS)
def test_scikit_learn_finds_no_larger_likelihood(
    kernel: Any, noise: float | None, true: float, most: float, seed: int
) -> None:
    """Its optimum is better by at most 1e-3 in length, 0.05 in length and noise."""
    random = np.random.default_rng(seed)
    u = np.append(0.0, np.sort(random.uniform(0, 1, 39)))[:, None]
    truth = THEIRS[kernel](10 ** random.uniform(-1.3, 0))(u)
    spread = np.linalg.cholesky(truth + true * np.eye(40))
    f = 10 ** random.uniform(-2, 2) * spread @ random.normal(size=(40, 3))
    ours = pdmp.GP(kernel, noise=noise).regress(u[:, 0], f)

    extent, unit = u[-1, 0], np.var(f)
    shape = THEIRS[kernel](0.3 * extent, length_scale_bounds=(extent / 40, 2 * extent))
    white = kernels.WhiteKernel(true, "fixed" if noise else (1e-10, 1e4))
    signal = kernels.ConstantKernel(unit, (1e-12 * unit, 1e12 * unit))
    theirs = process.GaussianProcessRegressor(
        signal * (shape + white), alpha=0.0, n_restarts_optimizer=2, random_state=seed
    ).fit(u, f)
    assert theirs.log_marginal_likelihood_value_ <= ours.log_likelihood + most


@pytest.mark.parametrize("deviation", [1e-3, 0.05, 0.5])
def test_noise_is_estimated_by_a_regression(deviation: float) -> None:
    """For two waves with white noise, the estimated deviation is accurate to a tenth."""
    u = np.linspace(0, 1, 500)
    waves = np.column_stack([np.sin(7 * u), np.cos(4 * u)])
    noise = deviation * np.random.default_rng(1).normal(size=waves.shape)
    found = pdmp.GP().regress(u, waves + noise)
    assert np.sqrt(found.noise * found.signal_variance) == pytest.approx(deviation, rel=0.1)
    assert np.abs(found.predict(u)[0] - waves).max() < deviation


def test_signal_variance_is_in_the_squared_unit_of_the_outputs() -> None:
    """Signal variance and density scale with the unit of the outputs."""
    u = np.linspace(0, 1, 50)
    f = np.column_stack([np.sin(7 * u), u**2])
    metres, millimetres = (pdmp.GP().regress(u, unit * f) for unit in (1, 1e3))
    assert millimetres.signal_variance == pytest.approx(1e6 * metres.signal_variance, rel=1e-6)
    denser = metres.log_likelihood - millimetres.log_likelihood
    assert denser == pytest.approx(f.size * np.log(1e3), rel=1e-6)


@pytest.mark.parametrize("kernel", THEIRS)
def test_zeros_have_no_variance(kernel: Any) -> None:
    """Outputs of zero have zero signal variance, likelihood and predictions."""
    regression = pdmp.GP(kernel).regress([0.0, 0.5, 1.0], np.zeros((3, 2)))
    assert (regression.signal_variance, regression.log_likelihood) == (0.0, 0.0)
    assert not np.any(regression.predict([0.2, 3.0]))


@pytest.mark.parametrize("kernel", THEIRS)
def test_a_process_states_its_hyperparameters(kernel: Any) -> None:
    """Kernel, length and noise are properties and part of the repr."""
    regression = pdmp.GP(kernel, 0.25, 1e-3).regress([0.0, 1.0], [[0.0], [1.0]])
    assert (regression.kernel, regression.length, regression.noise) == (kernel, 0.25, 1e-3)
    name = {"matern32": "Matern-3/2", "matern52": "Matern-5/2"}[kernel]
    text = f"<pdmp.GPRegression: Gaussian process, {name}, length 0.25, noise 1e-3>"
    assert repr(regression) == text
