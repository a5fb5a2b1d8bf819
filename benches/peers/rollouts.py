"""Whole movements: one, and many at once."""

from functools import partial

import numpy as np

from peers.arena import Begin, Work
from peers.libraries import EULER, RK4, movement_primitives_dmp, pydmps_dmp
from peers.movement import DT, N_DOFS, N_STYLES, primitive

N_ROLLOUTS = 1000


def pdmp_rollout() -> Begin:
    """Rolls out with velocities and accelerations."""
    return lambda: partial(primitive().rollout, dt=DT)


def movement_primitives_rollout(method: str) -> Begin:
    """Rolls out positions with the compiled Euler or Runge-Kutta method."""
    dmp = movement_primitives_dmp()
    return lambda: partial(dmp.open_loop, step_function=method)


def pydmps_rollout() -> Begin:
    """Rolls out with velocities and accelerations."""
    dmp = pydmps_dmp()
    return lambda: dmp.rollout


def pdmp_rollouts() -> Begin:
    """Rolls out many styles, with velocities."""
    styles = np.random.default_rng(0).normal(size=(N_ROLLOUTS, N_STYLES))
    return lambda: partial(primitive().rollouts, styles, dt=DT, threads=1)


def mp_pytorch_rollouts(kind: str) -> Begin:
    """Rolls out many weight vectors, with velocities, in float64 and on one thread.

    What is drawn differs in size: J style parameters there, ten weights for each degree of freedom
    here, and a goal too for ProDMP. ProMP's velocities are differences of its positions.
    """
    import torch
    from mp_pytorch.mp import MPFactory

    torch.set_num_threads(1)
    settings = {
        "num_basis": 10,
        "basis_bandwidth_factor": 2,
        "num_basis_outside": 0,
        "alpha": 25,
        "alpha_phase": 3,
        "dt": DT,
    }
    mp = MPFactory.init_mp(kind, settings, num_dof=N_DOFS, tau=1.0, dtype=torch.float64)
    of_each = torch.Generator().manual_seed(0)
    times = torch.linspace(0, 1, 1001, dtype=torch.float64).repeat(N_ROLLOUTS, 1)
    rest = torch.zeros((N_ROLLOUTS, N_DOFS), dtype=torch.float64)
    weights = torch.randn((N_ROLLOUTS, mp.num_params), generator=of_each, dtype=torch.float64)

    def roll() -> None:
        mp.update_inputs(times, weights, None, times[:, 0], rest, rest)
        mp.get_trajs(get_pos=True, get_vel=True)

    return lambda: roll


WORKS = [
    Work(
        "rollout of one second at 1 kHz, D=7",
        calls=1,
        bouts=40,
        contestants={
            "pdmp, J=3": pdmp_rollout,
            "movement_primitives, Euler": partial(movement_primitives_rollout, EULER),
            "movement_primitives, RK4": partial(movement_primitives_rollout, RK4),
            "pydmps, Euler": pydmps_rollout,
        },
    ),
    Work(
        f"{N_ROLLOUTS} rollouts of 1001 samples, D={N_DOFS}, with velocities",
        calls=1,
        bouts=10,
        contestants={
            "pdmp, J=3": pdmp_rollouts,
            "mp_pytorch, ProDMP": partial(mp_pytorch_rollouts, "prodmp"),
            "mp_pytorch, ProMP": partial(mp_pytorch_rollouts, "promp"),
        },
    ),
]
