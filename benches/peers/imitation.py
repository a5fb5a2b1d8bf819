"""Learning a primitive: from one demonstration, and from many."""

from functools import partial

import numpy as np

import pdmp
from peers.arena import Begin, Work
from peers.libraries import movement_primitives_dmp, pydmps_dmp
from peers.movement import DT, N_DOFS, N_STYLES, movement, movements

N_DEMOS = 20


def pdmp_imitate(basis: str) -> Begin:
    """Learns a primitive of one demonstration, with the check that its table is close enough."""
    demonstration = movement(1)
    return lambda: partial(pdmp.fit, [demonstration], dt=DT, basis=basis, threads=1)


def movement_primitives_imitate() -> Begin:
    """Learns one demonstration."""
    dmp = movement_primitives_dmp()
    return lambda: partial(dmp.imitate, np.linspace(0, 1, 1001), movement(1))


def pydmps_imitate() -> Begin:
    """Learns one demonstration."""
    dmp = pydmps_dmp()
    return lambda: partial(dmp.imitate_path, movement(1).T)


def pdmp_fit(basis: str) -> Begin:
    """Learns one primitive of all demonstrations, with as many styles as reproduce each of them."""
    settings = {"dt": DT, "n_styles": N_STYLES, "basis": basis, "threads": 1}
    return lambda: partial(pdmp.fit, movements(N_DEMOS), **settings)


def movement_primitives_promp() -> Begin:
    """Learns the distribution of ten weights for each degree of freedom, as many as by default.

    A few rounds of expectation maximisation suffice. What takes the time, and eight gigabytes, are
    matrices of all values by all values of a demonstration, one for each.
    """
    from movement_primitives.promp import ProMP

    positions = np.array(movements(N_DEMOS))
    times = np.tile(np.linspace(0, 1, positions.shape[1]), (N_DEMOS, 1))
    # One that has learnt starts from what it knows.
    return lambda: partial(ProMP(N_DOFS).imitate, times, positions)


WORKS = [
    Work(
        "imitation of one demonstration of 1001 samples, D=7",
        calls=1,
        bouts=10,
        contestants={
            "pdmp, network": partial(pdmp_imitate, "ngnet"),
            "pdmp, Gaussian process": partial(pdmp_imitate, "gp"),
            "movement_primitives": movement_primitives_imitate,
            "pydmps": pydmps_imitate,
        },
    ),
    Work(
        f"fit of {N_DEMOS} demonstrations of 1001 samples, D={N_DOFS}",
        calls=1,
        bouts=10,
        contestants={
            "pdmp, network": partial(pdmp_fit, "ngnet"),
            "pdmp, Gaussian process": partial(pdmp_fit, "gp"),
            "movement_primitives, ProMP": movement_primitives_promp,
        },
    ),
]
