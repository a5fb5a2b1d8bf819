"""Gaussian processes over one input, three outputs: conditioned, and with hyperparameters found."""

from functools import partial

import numpy as np

import pdmp
from peers.arena import Begin, Work

LENGTH = 0.2
# Variance of the noise, and its ratio to the signal's where both are given: less than pdmp's search
# leaves to noise at most, so that it and scikit-learn's have the same summit.
NOISE = 1e-7
MANY, SOME = 4000, 1000


def samples(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns inputs (C,) and three noisy outputs (C, 3) as wiggly as the weak factors of a set."""
    u = np.linspace(0, 1, count)
    clean = np.column_stack([np.sin(3 * u), np.sin(11 * u + 1), np.cos(23 * u)])
    return u, clean + NOISE**0.5 * np.random.default_rng(0).normal(size=clean.shape)


def pdmp_conditioned(kernel: str) -> Begin:
    """Conditions on the samples."""
    u, f = samples(MANY)
    gp = pdmp.GP(kernel, LENGTH, NOISE)
    return lambda: partial(gp.regress, u, f)


def scikit_learn_conditioned(nu: float) -> Begin:
    """Conditions on the samples through the dense covariance matrix, and finds their likelihood."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import Matern

    u, f = samples(MANY)
    gp = GaussianProcessRegressor(Matern(LENGTH, nu=nu), alpha=NOISE, optimizer=None)
    return lambda: partial(gp.fit, u[:, None], f)


def celerite2_conditioned() -> Begin:
    """Factorises the covariance and solves for the outputs: no variance is found here.

    Its Matérn-3/2 is the limit of two exponentials, taken as close as its default does.
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
    """Finds amplitude, length and noise, and conditions on the samples."""
    u, f = samples(count)
    return lambda: partial(pdmp.GP(kernel).regress, u, f)


def scikit_learn_found() -> Begin:
    """Finds amplitude, length and noise from one start near them, and conditions on the samples."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    u, f = samples(SOME)
    noise = WhiteKernel(NOISE, noise_level_bounds=(1e-10, 1.0))
    gp = GaussianProcessRegressor(ConstantKernel() * Matern(LENGTH, nu=2.5) + noise)
    return lambda: partial(gp.fit, u[:, None], f)


WORKS = [
    Work(
        f"Gaussian process of {MANY} samples, 3 outputs, Matérn-5/2, hyperparameters given",
        calls=1,
        bouts=20,
        contestants={
            "pdmp": partial(pdmp_conditioned, "matern52"),
            "scikit-learn": partial(scikit_learn_conditioned, 2.5),
        },
    ),
    Work(
        f"Gaussian process of {MANY} samples, 3 outputs, Matérn-3/2, hyperparameters given",
        calls=1,
        bouts=20,
        contestants={
            "pdmp": partial(pdmp_conditioned, "matern32"),
            "scikit-learn": partial(scikit_learn_conditioned, 1.5),
            "celerite2": celerite2_conditioned,
        },
    ),
    Work(
        f"Gaussian process of {SOME} samples, 3 outputs, Matérn-5/2, with hyperparameters",
        calls=1,
        bouts=5,
        contestants={
            "pdmp": partial(pdmp_found, "matern52", SOME),
            "scikit-learn": scikit_learn_found,
        },
    ),
    # Here scikit-learn would take some minutes.
    Work(
        f"Gaussian process of {MANY} samples, 3 outputs, Matérn-5/2, with hyperparameters",
        calls=1,
        bouts=20,
        contestants={"pdmp": partial(pdmp_found, "matern52", MANY)},
    ),
]
