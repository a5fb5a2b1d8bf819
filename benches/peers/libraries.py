"""Primitives of other libraries, fitted to one demonstration."""

from typing import Any

import numpy as np

from peers.movement import DT, N_BASIS, N_DOFS, movement

# Compiled methods of movement_primitives.
EULER, RK4 = "euler-cython", "rk4-cython"


def movement_primitives_dmp() -> Any:
    """Returns a primitive of movement_primitives, fitted to one demonstration."""
    from movement_primitives.dmp import DMP

    # With int_dt above dt, Euler takes one step per tick, regardless of rounding of the time.
    dmp = DMP(N_DOFS, execution_time=1.0, dt=DT, n_weights_per_dim=N_BASIS, int_dt=2 * DT)
    dmp.imitate(np.linspace(0, 1, 1001), movement(0))
    return dmp


def pydmps_dmp() -> Any:
    """Returns a primitive of pydmps, fitted to one demonstration."""
    from pydmps.dmp_discrete import DMPs_discrete

    dmp = DMPs_discrete(n_dmps=N_DOFS, n_bfs=N_BASIS, dt=DT)
    dmp.imitate_path(movement(0).T)
    return dmp
