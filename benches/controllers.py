"""Time of a tick of 4096 movements in Python: together, one by one, and by plain array programs.

`python benches/controllers.py` prints the median times of a tick of B = 4096 movements with D = 7
and J = 3, each under its own style, goal and τ, on one thread. The plain programs integrate the
same kind of primitive by Euler's method in numpy and, where it is installed, torch: transformation
system, phase, and a forcing term from 50 basis functions. They have no filters of commands, limits,
exact steps or status. mp_pytorch, where it is installed, replans at every tick: it computes
position and velocity at the next sample from the present ones, for B ProDMPs with ten weights and
a goal for each degree of freedom.
"""

import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np

import pdmp

B, D, J, N_BASIS, DT = 4096, 7, 3, 50, 1e-3
ALPHA, BETA, ALPHA_X = 25.0, 6.25, 4.6


def median(tick: Callable[[], object], restart: Callable[[], object], ticks: int = 200) -> float:
    """Returns the median time of a tick in µs, over runs that `restart` begins."""
    times = []
    for _ in range(3):
        restart()
        tick()
        for _ in range(ticks):
            begin = time.perf_counter()
            tick()
            times.append(time.perf_counter() - begin)
    return 1e6 * float(np.median(times))


def learnt() -> pdmp.Model:
    """Returns a model of synthetic movements of a second."""
    rng = np.random.default_rng(0)
    s = np.linspace(0, 1, 501)[:, None]
    ramp = s**3 * (10 - 15 * s + 6 * s**2)
    shapes = [
        np.sin(np.pi * (k + 1) * s) * np.sin(np.pi * s) * rng.normal(size=D) for k in range(J)
    ]
    demos = []
    for _ in range(20):
        weights = rng.normal(size=J)
        bends = sum(weight * shape for weight, shape in zip(weights, shapes, strict=True))
        demos.append(np.arange(1, D + 1) * ramp + bends)
    return pdmp.fit(demos, dt=1 / 500, n_styles=J, basis="ngnet")


class Plain:
    """Discrete movements by Euler's method, in the array library `xp`."""

    def __init__(self, xp: Any, convert: Callable[[Any], Any]) -> None:
        rng = np.random.default_rng(1)
        self.xp = xp
        self.style, self.goal = convert(rng.normal(size=(B, J))), convert(rng.normal(size=(B, D)))
        self.rate = convert(1 / rng.uniform(0.8, 1.5, (B, 1)))
        self.centres = convert(np.exp(-ALPHA_X * np.linspace(0, 1, N_BASIS)))
        self.widths = convert(N_BASIS**1.5 / np.exp(-ALPHA_X * np.linspace(0, 1, N_BASIS)))
        self.weights = convert(rng.normal(size=(N_BASIS, J * D)))
        self.zeros, self.ones = convert(np.zeros((B, D))), convert(np.ones((B, 1)))
        self.restart()

    def restart(self) -> None:
        """Sets the movements to their start."""
        self.position, self.z, self.phase = self.zeros, self.zeros, self.ones

    def tick(self) -> None:
        """Performs one tick."""
        psi = self.xp.exp(-self.widths * (self.phase - self.centres) ** 2)
        landscape = ((psi / psi.sum(1)[:, None]) @ self.weights).reshape(B, J, D)
        forcing = self.phase * (self.style[:, :, None] * landscape).sum(1)
        velocity = self.rate * (self.z + forcing)
        slope = ALPHA * (BETA * (self.goal - self.position) - self.z)
        self.acceleration = self.rate * (self.rate * slope)
        self.position = self.position + DT * velocity
        self.z = self.z + DT * self.rate * slope
        self.phase = self.phase * (1 - DT * ALPHA_X * self.rate)


class Replanned:
    """ProDMPs of mp_pytorch in double precision, replanned from their motion at every tick."""

    def __init__(self) -> None:
        import torch
        from mp_pytorch.mp import MPFactory

        settings = {
            "num_basis": 10,
            "basis_bandwidth_factor": 2,
            "num_basis_outside": 0,
            "alpha": 25,
            "alpha_phase": 3,
            "dt": DT,
        }
        self.mp = MPFactory.init_mp(
            "prodmp", settings, num_dof=D, tau=1.0, learn_tau=True, dtype=torch.float64
        )
        generator = torch.Generator().manual_seed(0)
        numbers = {"generator": generator, "dtype": torch.float64}
        self.parameters = torch.randn((B, self.mp.num_params), **numbers)
        self.parameters[:, 0] = 0.8 + 0.7 * torch.rand(B, **numbers)
        self.zeros = [torch.zeros(shape, dtype=torch.float64) for shape in (B, (B, D), (B, D))]
        self.restart()

    def restart(self) -> None:
        """Sets the movements to their start."""
        self.time, self.position, self.velocity = self.zeros

    def tick(self) -> None:
        """Performs one tick."""
        ahead = self.time + DT
        self.mp.update_inputs(
            ahead[:, None], self.parameters, None, self.time, self.position, self.velocity
        )
        motion = self.mp.get_trajs(
            get_pos=True,
            get_pos_cov=False,
            get_pos_std=False,
            get_vel=True,
            get_vel_cov=False,
            get_vel_std=False,
        )
        self.time, self.position, self.velocity = ahead, motion["pos"][:, 0], motion["vel"][:, 0]


def main() -> None:
    """Prints the table."""
    model = learnt()
    rng = np.random.default_rng(2)
    styles, goals = rng.normal(0, 0.2, (B, J)), rng.normal(0, 1, (B, D))
    taus = rng.uniform(0.8, 1.5, B)
    conditions = {"style": styles, "goal": goals, "tau": taus}
    together = model.controllers(B, DT, **conditions)
    rows = [("pdmp.Controllers", median(together.step, lambda: together.reset(**conditions)))]
    moved = [goals + 0.01 * k for k in range(2)]
    turn = iter(range(1_000_000))
    commanded = median(
        lambda: together.step(goal=moved[next(turn) % 2]), lambda: together.reset(**conditions), 50
    )
    rows.append(("pdmp.Controllers, new goals at every tick", commanded))
    alone = [model.controller(DT, style=styles[b], goal=goals[b], tau=taus[b]) for b in range(B)]

    def each() -> None:
        for controller in alone:
            controller.step()

    rows.append(("4096 pdmp.Controller", median(each, lambda: None, 20)))
    plain = Plain(np, np.asarray)
    rows.append(("plain program in numpy", median(plain.tick, plain.restart)))
    if find_spec("torch"):
        import torch

        torch.set_num_threads(1)
        tensors = Plain(torch, torch.from_numpy)
        rows.append(("plain program in torch", median(tensors.tick, tensors.restart)))
        if find_spec("mp_pytorch"):
            replanned = Replanned()
            name = "mp_pytorch, replanned at every tick"
            rows.append((name, median(replanned.tick, replanned.restart, 20)))
    print(f"| tick of {B} movements, D = {D}, J = {J} | µs | ns a movement |\n|---|--:|--:|")
    for name, value in rows:
        print(f"| {name} | {value:.0f} | {1000 * value / B:.0f} |")


if __name__ == "__main__":
    main()
