"""Primitives of other libraries that have learnt one demonstration."""

from typing import Any

import numpy as np

from peers.movement import DT, N_BASIS, N_DOFS, movement

# Methods of movement_primitives, compiled.
EULER, RK4 = "euler-cython", "rk4-cython"


def movement_primitives_dmp() -> Any:
    """Makes a primitive of movement_primitives that has learnt one demonstration."""
    from movement_primitives.dmp import DMP

    # An int_dt above dt lets Euler take a tick in one piece, for any rounding of the time.
    dmp = DMP(N_DOFS, execution_time=1.0, dt=DT, n_weights_per_dim=N_BASIS, int_dt=2 * DT)
    dmp.imitate(np.linspace(0, 1, 1001), movement(0))
    return dmp


def pydmps_dmp() -> Any:
    """Makes a primitive of pydmps that has learnt one demonstration."""
    from pydmps.dmp_discrete import DMPs_discrete

    dmp = DMPs_discrete(n_dmps=N_DOFS, n_bfs=N_BASIS, dt=DT)
    dmp.imitate_path(movement(0).T)
    return dmp
