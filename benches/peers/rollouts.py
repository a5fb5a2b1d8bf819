"""Rollouts of one movement and of many."""

from functools import partial

import numpy as np

from peers.libraries import EULER, RK4, movement_primitives_dmp, pydmps_dmp
from peers.movement import DT, N_DOFS, N_STYLES, primitive
from peers.timing import Begin, Task

N_ROLLOUTS = 1000


def pdmp_rollout() -> Begin:
    """Computes a rollout with velocities and accelerations."""
    return lambda: partial(primitive().rollout, dt=DT)


def movement_primitives_rollout(method: str) -> Begin:
    """Computes positions with the compiled Euler or Runge-Kutta method."""
    dmp = movement_primitives_dmp()
    return lambda: partial(dmp.open_loop, step_function=method)


def pydmps_rollout() -> Begin:
    """Computes a rollout with velocities and accelerations."""
    dmp = pydmps_dmp()
    return lambda: dmp.rollout


def pdmp_rollouts() -> Begin:
    """Computes rollouts of many styles, with velocities."""
    styles = np.random.default_rng(0).normal(size=(N_ROLLOUTS, N_STYLES))
    return lambda: partial(primitive().rollouts, style=styles, dt=DT, threads=1)


def mp_pytorch_rollouts(kind: str) -> Begin:
    """Computes rollouts of many weight vectors, with velocities, in float64 and on one thread.

    The inputs differ in size: J style parameters for pdmp; here ten weights per degree of freedom,
    and a goal for ProDMP. The velocities of ProMP are differences of its positions.
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


TASKS = [
    Task(
        "rollout of one second at 1 kHz, D=7",
        rounds=40,
        libraries={
            "pdmp, J=3": pdmp_rollout,
            "movement_primitives, Euler": partial(movement_primitives_rollout, EULER),
            "movement_primitives, RK4": partial(movement_primitives_rollout, RK4),
            "pydmps, Euler": pydmps_rollout,
        },
    ),
    Task(
        f"{N_ROLLOUTS} rollouts of 1001 samples, D={N_DOFS}, with velocities",
        rounds=10,
        libraries={
            "pdmp, J=3": pdmp_rollouts,
            "mp_pytorch, ProDMP": partial(mp_pytorch_rollouts, "prodmp"),
            "mp_pytorch, ProMP": partial(mp_pytorch_rollouts, "promp"),
        },
    ),
]
