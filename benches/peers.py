"""pdmp beside its peers: the same work, side by side, in one run.

``make bench-peers`` installs the peers and runs this. Contestants take turns, bout by bout, so that
a machine that slows down slows all of them; garbage collection is off, and BLAS has the one thread
that the Makefile gives it. A bout is run twice: first with every call timed by itself, which gives
p99.9 and the worst and finds the caches as the others left them; then with twenty timed together,
so that the clock costs nothing, which gives the median. Ratios are those of the medians.
"""

import gc
import os
import platform
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import PackageNotFoundError, version
from itertools import cycle
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np

import pdmp

N_DOFS = 7
N_STYLES = 3
DT = 0.001  # s
TICKS = 800  # within the second that the movement lasts: no one finishes early
# Few enough that hardly any of them meet another process, even where a call is slow.
TOGETHER = 20
# As many functions for every learner as pdmp's network has by default.
N_BASIS = 50

Call = Callable[[], object]
# Makes ready for a bout, untimed, and hands out the call to time.
Begin = Callable[[], Call]


@dataclass(frozen=True)
class Work:
    """What is timed: so many calls a bout, so many bouts, and who takes part."""

    title: str
    calls: int
    bouts: int
    contestants: dict[str, Callable[[], Begin]]  # the first is what the others are compared with


def movement(style: float) -> np.ndarray:
    """Return a reach of one second (1001, D) whose bends go with the style and with its square."""
    s = np.linspace(0, 1, 1001)[:, None]
    d = np.arange(N_DOFS)
    reach = s**3 * (10 - 15 * s + 6 * s**2) * (1 + d)
    once, twice = np.sin(np.pi * s) ** 2, np.sin(np.pi * s) * np.sin(2 * np.pi * s)
    return reach + style * once * np.cos(d) + style**2 * twice * np.sin(d)


@cache
def primitive() -> pdmp.Model:
    """Learn pdmp's primitive from ten movements, which J = 3 reproduces."""
    return pdmp.fit([movement(style) for style in np.linspace(0, 1, 10)], dt=DT, n_styles=N_STYLES)


def goals() -> list[np.ndarray]:
    """Return two goals, to be given in turn."""
    return [movement(0)[-1], movement(0)[-1] + 0.1]


def pdmp_settled() -> Begin:
    """Step with style, goal and tau at rest."""
    controller = primitive().controller(dt=DT)

    def begin() -> Call:
        controller.reset()
        controller.step()
        return controller.step

    return begin


def pdmp_live() -> Begin:
    """Step with style, goal and tau on their way to others: 800 ticks do not end the transition."""
    model = primitive()
    controller = model.controller(dt=DT)

    def begin() -> Call:
        controller.reset()
        controller.step()
        controller.style = model.styles[1]
        controller.goal = model.goals[1] + 0.1
        controller.tau = 1.2 * model.tau
        return controller.step

    return begin


def pdmp_new_goal() -> Begin:
    """Step with a goal set before each; the filter of the goal starts anew."""
    controller = primitive().controller(dt=DT)
    targets = cycle(goals())

    def tick() -> None:
        controller.goal = next(targets)
        controller.step()

    def begin() -> Call:
        controller.reset()
        controller.step()
        return tick

    return begin


def pdmp_rollout() -> Begin:
    """Roll out with velocities and accelerations."""
    return lambda: partial(primitive().rollout, dt=DT)


def pdmp_imitate(basis: str) -> Begin:
    """Learn a primitive of one demonstration, with the check that its table is close enough."""
    demonstration = movement(1)
    return lambda: partial(pdmp.fit, [demonstration], dt=DT, basis=basis)


def ruckig_start() -> tuple[Any, Any, Any]:
    """Make generator, input and output for the same way with limits that let it last a second.

    The work differs in kind: no shape is learnt or followed. A jerk-limited trajectory is computed
    when the target changes and sampled at every other tick.
    """
    from ruckig import InputParameter, OutputParameter, Ruckig

    given = InputParameter(N_DOFS)
    given.target_position = movement(0)[-1].tolist()
    given.max_velocity = [10.0] * N_DOFS
    given.max_acceleration = [40.0] * N_DOFS
    given.max_jerk = [400.0] * N_DOFS
    return Ruckig(N_DOFS, DT), given, OutputParameter(N_DOFS)


def ruckig_rest(given: Any) -> None:
    """Put the input at rest at the start of the way."""
    given.current_position = movement(0)[0].tolist()
    given.current_velocity = [0.0] * N_DOFS
    given.current_acceleration = [0.0] * N_DOFS


def ruckig_sample() -> Begin:
    """Sample a trajectory: its computation, in the first update, is not timed."""
    generator, given, output = ruckig_start()

    def tick() -> None:
        generator.update(given, output)
        output.pass_to_input(given)

    def begin() -> Call:
        ruckig_rest(given)
        tick()
        return tick

    return begin


def ruckig_new_goal() -> Begin:
    """Compute a trajectory at every tick, to a target set before each."""
    generator, given, output = ruckig_start()
    targets = cycle([goal.tolist() for goal in goals()])

    def tick() -> None:
        given.target_position = next(targets)
        generator.update(given, output)
        output.pass_to_input(given)

    def begin() -> Call:
        ruckig_rest(given)
        tick()
        return tick

    return begin


def movement_primitives_dmp() -> Any:
    """Make a primitive of movement_primitives that has learnt one demonstration."""
    from movement_primitives.dmp import DMP

    # An int_dt above dt lets Euler take a tick in one piece, whatever the rounding of the time.
    dmp = DMP(N_DOFS, execution_time=1.0, dt=DT, n_weights_per_dim=N_BASIS, int_dt=2 * DT)
    dmp.imitate(np.linspace(0, 1, 1001), movement(0))
    return dmp


def movement_primitives_step(method: str, new_goal: bool) -> Begin:
    """Step with the compiled Euler or Runge-Kutta method."""
    dmp = movement_primitives_dmp()
    targets = cycle(goals())
    state = [dmp.start_y, dmp.start_yd]

    def tick() -> None:
        state[:] = dmp.step(*state, step_function=method)

    def tick_to_new_goal() -> None:
        dmp.configure(goal_y=next(targets))
        tick()

    def begin() -> Call:
        dmp.reset()
        state[:] = dmp.start_y, dmp.start_yd
        tick()
        return tick_to_new_goal if new_goal else tick

    return begin


def movement_primitives_rollout(method: str) -> Begin:
    """Roll out positions with the compiled Euler or Runge-Kutta method."""
    dmp = movement_primitives_dmp()
    return lambda: partial(dmp.open_loop, step_function=method)


def movement_primitives_imitate() -> Begin:
    """Learn one demonstration."""
    dmp = movement_primitives_dmp()
    return lambda: partial(dmp.imitate, np.linspace(0, 1, 1001), movement(1))


def pydmps_dmp() -> Any:
    """Make a primitive of pydmps that has learnt one demonstration."""
    from pydmps.dmp_discrete import DMPs_discrete

    dmp = DMPs_discrete(n_dmps=N_DOFS, n_bfs=N_BASIS, dt=DT)
    dmp.imitate_path(movement(0).T)
    return dmp


def pydmps_step(new_goal: bool) -> Begin:
    """Step with its Euler method."""
    dmp = pydmps_dmp()
    targets = cycle(goals())

    def tick_to_new_goal() -> None:
        dmp.goal = next(targets)
        dmp.step()

    def begin() -> Call:
        dmp.reset_state()
        dmp.step()
        return tick_to_new_goal if new_goal else dmp.step

    return begin


def pydmps_rollout() -> Begin:
    """Roll out with velocities and accelerations."""
    dmp = pydmps_dmp()
    return lambda: dmp.rollout


def pydmps_imitate() -> Begin:
    """Learn one demonstration."""
    dmp = pydmps_dmp()
    return lambda: partial(dmp.imitate_path, movement(1).T)


EULER, RK4 = "euler-cython", "rk4-cython"
WORKS = [
    Work(
        "one step, D=7, at 1 kHz",
        calls=TICKS,
        bouts=40,
        contestants={
            "pdmp, J=3": pdmp_settled,
            "pdmp, J=3, style, goal and tau in transition": pdmp_live,
            "ruckig, sampling its trajectory": ruckig_sample,
            "movement_primitives, Euler": partial(movement_primitives_step, EULER, False),
            "movement_primitives, RK4": partial(movement_primitives_step, RK4, False),
            "pydmps, Euler": partial(pydmps_step, False),
        },
    ),
    Work(
        "one step, D=7, to a goal that is new at every tick",
        calls=TICKS,
        bouts=40,
        contestants={
            "pdmp, J=3": pdmp_new_goal,
            "ruckig, computing its trajectory": ruckig_new_goal,
            "movement_primitives, Euler": partial(movement_primitives_step, EULER, True),
            "movement_primitives, RK4": partial(movement_primitives_step, RK4, True),
            "pydmps, Euler": partial(pydmps_step, True),
        },
    ),
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
]


def times(begin: Begin, calls: int, together: int) -> Iterator[float]:
    """Give the time of one call, in ns, from as many as are timed together, through a bout."""
    call = begin()
    for _ in range(calls // together):
        start = perf_counter_ns()
        for _ in range(together):
            call()
        yield (perf_counter_ns() - start) / together


def run(work: Work) -> None:
    """Time a work and print its table."""
    print(f"\n{work.title}, {work.bouts} bouts of {work.calls}")
    ready: dict[str, Begin] = {}
    for name, prepare in work.contestants.items():
        try:
            ready[name] = prepare()
        except ImportError as reason:
            print(f"left out: {name}: {reason}")
    singly: dict[str, list[float]] = {name: [] for name in ready}
    together: dict[str, list[float]] = {name: [] for name in ready}
    for _ in range(work.bouts):
        for name, begin in ready.items():
            singly[name].extend(times(begin, work.calls, 1))
            together[name].extend(times(begin, work.calls, min(TOGETHER, work.calls)))
    medians = {name: float(np.median(found)) for name, found in together.items()}
    first = next(iter(medians.values()))
    print(f"\n| {'contestant':<46} |  median |   p99.9 |   worst |  ratio |")
    print(f"|{'-' * 48}|--------:|--------:|--------:|-------:|")
    for name, median in medians.items():
        # A few dozen calls have no thousandth.
        often = written(np.quantile(singly[name], 0.999)) if work.calls > 1 else "–"
        figures = f"{written(median):>7} | {often:>7} | {written(max(singly[name])):>7}"
        print(f"| {name:<46} | {figures} | {median / first:>6.3g} |")


def written(ns: float) -> str:
    """Write a time with three digits."""
    units = [(1e9, "s"), (1e6, "ms"), (1e3, "µs")]
    size, unit = next((pair for pair in units if ns >= pair[0]), (1, "ns"))
    return f"{ns / size:#.3g}".rstrip(".") + f" {unit}"


def machine() -> str:
    """Name the processor, as far as the system tells."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def installed(package: str) -> str:
    """Name a package with its version."""
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return f"{package} missing"


def main() -> None:
    """Print what is compared, and where, and then the tables."""
    packages = ["pdmp", "movement_primitives", "pydmps", "ruckig", "numpy"]
    print(f"{machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    print(", ".join(installed(package) for package in packages))
    gc.disable()
    for work in WORKS:
        gc.collect()
        run(work)


if __name__ == "__main__":
    main()
