"""One tick of a control loop."""

from functools import partial
from itertools import cycle
from typing import Any

from peers.libraries import EULER, RK4, movement_primitives_dmp, pydmps_dmp
from peers.movement import DT, N_DOFS, goals, movement, primitive
from peers.timing import Begin, Call, Task

TICKS = 800  # within the duration of one second, so that no movement ends earlier


def after(*calls: Call, tick: Call) -> Begin:
    """Returns a preparation of rounds of ticks by some calls."""

    def begin() -> Call:
        for call in calls:
            call()
        return tick

    return begin


def pdmp_settled() -> Begin:
    """Steps with constant style, goal and tau."""
    controller = primitive().controller(dt=DT)
    return after(controller.reset, controller.step, tick=controller.step)


def pdmp_live() -> Begin:
    """Steps with style, goal and tau in a transition that lasts for all ticks."""
    model = primitive()
    controller = model.controller(dt=DT, transition=DT * TICKS)

    def change() -> None:
        controller.style = model.styles[1]
        controller.goal = model.goals[1] + 0.1
        controller.tau = 1.2 * model.tau

    return after(controller.reset, controller.step, change, tick=controller.step)


def pdmp_new_goal() -> Begin:
    """Steps with a new goal before each tick; the filter of the goal restarts."""
    controller = primitive().controller(dt=DT)
    targets = cycle(goals())

    def tick() -> None:
        controller.goal = next(targets)
        controller.step()

    return after(controller.reset, controller.step, tick=tick)


def ruckig_start() -> tuple[Any, Any, Any]:
    """Returns generator, input and output, with limits for a duration of a second.

    The task differs in kind: no shape is learnt or followed. A jerk-limited trajectory is computed
    when the target changes, and sampled at all other ticks.
    """
    from ruckig import InputParameter, OutputParameter, Ruckig

    parameters = InputParameter(N_DOFS)
    parameters.target_position = movement(0)[-1].tolist()
    parameters.max_velocity = [10.0] * N_DOFS
    parameters.max_acceleration = [40.0] * N_DOFS
    parameters.max_jerk = [400.0] * N_DOFS
    return Ruckig(N_DOFS, DT), parameters, OutputParameter(N_DOFS)


def ruckig_rest(parameters: Any) -> None:
    """Sets the input to rest at the start."""
    parameters.current_position = movement(0)[0].tolist()
    parameters.current_velocity = [0.0] * N_DOFS
    parameters.current_acceleration = [0.0] * N_DOFS


def ruckig_sample() -> Begin:
    """Samples a trajectory; its computation, in the first update, is not timed."""
    generator, parameters, output = ruckig_start()

    def tick() -> None:
        generator.update(parameters, output)
        output.pass_to_input(parameters)

    return after(partial(ruckig_rest, parameters), tick, tick=tick)


def ruckig_new_goal() -> Begin:
    """Computes a trajectory at every tick, with a new target before each."""
    generator, parameters, output = ruckig_start()
    targets = cycle([goal.tolist() for goal in goals()])

    def tick() -> None:
        parameters.target_position = next(targets)
        generator.update(parameters, output)
        output.pass_to_input(parameters)

    return after(partial(ruckig_rest, parameters), tick, tick=tick)


def movement_primitives_step(method: str, new_goal: bool) -> Begin:
    """Steps with the compiled Euler or Runge-Kutta method."""
    dmp = movement_primitives_dmp()
    targets = cycle(goals())
    state = [dmp.start_y, dmp.start_yd]

    def tick() -> None:
        state[:] = dmp.step(*state, step_function=method)

    def reset() -> None:
        dmp.reset()
        state[:] = dmp.start_y, dmp.start_yd

    def tick_to_new_goal() -> None:
        dmp.configure(goal_y=next(targets))
        tick()

    return after(reset, tick, tick=tick_to_new_goal if new_goal else tick)


def pydmps_step(new_goal: bool) -> Begin:
    """Steps with its Euler method."""
    dmp = pydmps_dmp()
    targets = cycle(goals())

    def tick_to_new_goal() -> None:
        dmp.goal = next(targets)
        dmp.step()

    return after(dmp.reset_state, dmp.step, tick=tick_to_new_goal if new_goal else dmp.step)


TASKS = [
    Task(
        "one step, D=7, at 1 kHz",
        calls=TICKS,
        rounds=40,
        libraries={
            "pdmp, J=3": pdmp_settled,
            "pdmp, J=3, style, goal and tau in transition": pdmp_live,
            "ruckig, sampling its trajectory": ruckig_sample,
            "movement_primitives, Euler": partial(movement_primitives_step, EULER, False),
            "movement_primitives, RK4": partial(movement_primitives_step, RK4, False),
            "pydmps, Euler": partial(pydmps_step, False),
        },
    ),
    Task(
        "one step, D=7, to a goal that is new at every tick",
        calls=TICKS,
        rounds=40,
        libraries={
            "pdmp, J=3": pdmp_new_goal,
            "ruckig, computing its trajectory": ruckig_new_goal,
            "movement_primitives, Euler": partial(movement_primitives_step, EULER, True),
            "movement_primitives, RK4": partial(movement_primitives_step, RK4, True),
            "pydmps, Euler": partial(pydmps_step, True),
        },
    ),
]
