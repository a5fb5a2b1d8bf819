"""Fits of a primitive to one demonstration and to many."""

from functools import partial

import numpy as np

import pdmp
from peers.libraries import movement_primitives_dmp, pydmps_dmp
from peers.movement import DT, N_DOFS, N_STYLES, movement, movements
from peers.timing import Begin, Task

N_DEMOS = 20


def pdmp_imitate(basis: str) -> Begin:
    """Fits a primitive to one demonstration, including the check of its table error."""
    demonstration = movement(1)
    return lambda: partial(pdmp.fit, [demonstration], dt=DT, basis=basis, threads=1)


def movement_primitives_imitate() -> Begin:
    """Fits a primitive to one demonstration."""
    dmp = movement_primitives_dmp()
    return lambda: partial(dmp.imitate, np.linspace(0, 1, 1001), movement(1))


def pydmps_imitate() -> Begin:
    """Fits a primitive to one demonstration."""
    dmp = pydmps_dmp()
    return lambda: partial(dmp.imitate_path, movement(1).T)


def pdmp_fit(basis: str) -> Begin:
    """Fits one primitive to all demonstrations, with enough styles to reproduce each of them."""
    settings = {"dt": DT, "n_styles": N_STYLES, "basis": basis, "threads": 1}
    return lambda: partial(pdmp.fit, movements(N_DEMOS), **settings)


def movement_primitives_promp() -> Begin:
    """Fits the distribution of ten weights per degree of freedom, the default number.

    A few iterations of expectation maximisation suffice. The time, and eight gigabytes of memory,
    are due to a matrix of all values by all values for each demonstration.
    """
    from movement_primitives.promp import ProMP

    positions = np.array(movements(N_DEMOS))
    times = np.tile(np.linspace(0, 1, positions.shape[1]), (N_DEMOS, 1))
    # A fitted one would start from its last result.
    return lambda: partial(ProMP(N_DOFS).imitate, times, positions)


TASKS = [
    Task(
        "imitation of one demonstration of 1001 samples, D=7",
        rounds=10,
        libraries={
            "pdmp, network": partial(pdmp_imitate, "ngnet"),
            "pdmp, Gaussian process": partial(pdmp_imitate, "gp"),
            "movement_primitives": movement_primitives_imitate,
            "pydmps": pydmps_imitate,
        },
    ),
    Task(
        f"fit of {N_DEMOS} demonstrations of 1001 samples, D={N_DOFS}",
        rounds=10,
        libraries={
            "pdmp, network": partial(pdmp_fit, "ngnet"),
            "pdmp, Gaussian process": partial(pdmp_fit, "gp"),
            "movement_primitives, ProMP": movement_primitives_promp,
        },
    ),
]
