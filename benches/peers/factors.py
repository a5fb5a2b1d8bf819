"""Factors of the targets: all of a small set, the leading ones of a large set."""

from functools import cache, partial

import numpy as np

import pdmp
from peers.timing import Begin, Task

SMALL = (20, 28_000)
LARGE = (1000, 40_000)
N_LEADING = 5


def library(n_demos: int, n_values: int) -> np.ndarray:
    """Returns noisy targets (M, C·D) of forty factors, each half as strong as the previous one."""
    random = np.random.default_rng(0)
    strengths = 0.5 ** np.arange(40)
    left, right = random.normal(size=(n_demos, 40)), random.normal(size=(40, n_values))
    return (left * strengths) @ right + 1e-3 * random.normal(size=(n_demos, n_values))


# The large set takes a third of a gigabyte, which the libraries share.
targets = cache(library)


def pdmp_factors(shape: tuple[int, int], n_styles: int) -> Begin:
    """Computes the leading `n_styles` factors."""
    return lambda: partial(pdmp.factorise, targets(*shape), n_styles=n_styles)


def numpy_factors(shape: tuple[int, int]) -> Begin:
    """Computes all factors by the divide-and-conquer method of LAPACK."""
    return lambda: partial(np.linalg.svd, targets(*shape), full_matrices=False)


def scipy_factors() -> Begin:
    """Computes the leading factors by Lanczos iteration, to machine precision."""
    from scipy.sparse.linalg import svds

    return lambda: partial(svds, targets(*LARGE), k=N_LEADING, random_state=0)


def scikit_learn_factors() -> Begin:
    """Computes the leading factors by random projection, with the default precision."""
    from sklearn.utils.extmath import randomized_svd

    return lambda: partial(randomized_svd, targets(*LARGE), N_LEADING, random_state=0)


TASKS = [
    Task(
        "singular value decomposition of {} × {}".format(*SMALL),
        rounds=20,
        libraries={
            "pdmp": partial(pdmp_factors, SMALL, SMALL[0]),
            "numpy": partial(numpy_factors, SMALL),
        },
    ),
    Task(
        "{} leading factors of {} × {}".format(N_LEADING, *LARGE),
        rounds=5,
        libraries={
            "pdmp": partial(pdmp_factors, LARGE, N_LEADING),
            "pdmp, all of them": partial(pdmp_factors, LARGE, LARGE[0]),
            "scikit-learn, randomised": scikit_learn_factors,
            "scipy, Lanczos": scipy_factors,
            "numpy, all of them": partial(numpy_factors, LARGE),
        },
    ),
]
