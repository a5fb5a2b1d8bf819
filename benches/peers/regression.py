"""Gaussian processes with three outputs, hyperparameters given or optimised."""

from functools import partial

import numpy as np

import pdmp
from peers.timing import Begin, Task

LENGTH = 0.2
# Variance of the noise, and its ratio to that of the signal where both are given. The ratio is
# below the upper bound of pdmp's search, so that its optimum is that of scikit-learn.
NOISE = 1e-7
MANY, SOME = 4000, 1000


def samples(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns inputs (C,) and three noisy outputs (C, 3) as rough as weak factors."""
    u = np.linspace(0, 1, count)
    clean = np.column_stack([np.sin(3 * u), np.sin(11 * u + 1), np.cos(23 * u)])
    return u, clean + NOISE**0.5 * np.random.default_rng(0).normal(size=clean.shape)


def pdmp_conditioned(kernel: str) -> Begin:
    """Conditions on the samples."""
    u, f = samples(MANY)
    gp = pdmp.GP(kernel, LENGTH, NOISE)
    return lambda: partial(gp.regress, u, f)


def scikit_learn_conditioned(nu: float) -> Begin:
    """Conditions on the samples by the dense covariance matrix; computes the likelihood."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import Matern

    u, f = samples(MANY)
    gp = GaussianProcessRegressor(Matern(LENGTH, nu=nu), alpha=NOISE, optimizer=None)
    return lambda: partial(gp.fit, u[:, None], f)


def celerite2_conditioned() -> Begin:
    """Factorises the covariance and solves for the outputs; no variance is computed.

    Its Matérn-3/2 is the limit of two exponentials, as close as its default.
    """
    from celerite2 import GaussianProcess
    from celerite2.terms import Matern32Term

    u, f = samples(MANY)
    gp = GaussianProcess(Matern32Term(sigma=1.0, rho=LENGTH))

    def condition() -> None:
        gp.compute(u, diag=np.full(MANY, NOISE))
        gp.apply_inverse(f)

    return lambda: condition


def pdmp_found(kernel: str, count: int) -> Begin:
    """Optimises amplitude, length and noise, and conditions on the samples."""
    u, f = samples(count)
    return lambda: partial(pdmp.GP(kernel).regress, u, f)


def scikit_learn_found() -> Begin:
    """Optimises from one start near the optimum, and conditions on the samples."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    u, f = samples(SOME)
    noise = WhiteKernel(NOISE, noise_level_bounds=(1e-10, 1.0))
    gp = GaussianProcessRegressor(ConstantKernel() * Matern(LENGTH, nu=2.5) + noise)
    return lambda: partial(gp.fit, u[:, None], f)


TASKS = [
    Task(
        f"Gaussian process of {MANY} samples, 3 outputs, Matérn-5/2, hyperparameters given",
        rounds=20,
        libraries={
            "pdmp": partial(pdmp_conditioned, "matern52"),
            "scikit-learn": partial(scikit_learn_conditioned, 2.5),
        },
    ),
    Task(
        f"Gaussian process of {MANY} samples, 3 outputs, Matérn-3/2, hyperparameters given",
        rounds=20,
        libraries={
            "pdmp": partial(pdmp_conditioned, "matern32"),
            "scikit-learn": partial(scikit_learn_conditioned, 1.5),
            "celerite2": celerite2_conditioned,
        },
    ),
    Task(
        f"Gaussian process of {SOME} samples, 3 outputs, Matérn-5/2, with hyperparameters",
        rounds=5,
        libraries={
            "pdmp": partial(pdmp_found, "matern52", SOME),
            "scikit-learn": scikit_learn_found,
        },
    ),
    # scikit-learn would take some minutes.
    Task(
        f"Gaussian process of {MANY} samples, 3 outputs, Matérn-5/2, with hyperparameters",
        rounds=20,
        libraries={"pdmp": partial(pdmp_found, "matern52", MANY)},
    ),
]
