"""The control loop: a movement is stepped, and the robot driven along it, at 1 kHz."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import pdmp
from reproduction.reaching import Reaching
from reproduction.robot import DT, Robot, boxes

Array = NDArray[np.float64]

PACE = 0.6  # s: tau on the robot, as printed; twice that of the learning
LONGEST = 30.0  # s


class Movement(Protocol):
    """What a loop needs to know of a controller."""

    goal: Any

    def step(self, *, measured: Array | None = None) -> pdmp.Status:
        """Takes one tick."""

    @property
    def position(self) -> Array: ...  # noqa: D102
    @property
    def velocity(self) -> Array: ...  # noqa: D102
    @property
    def acceleration(self) -> Array: ...  # noqa: D102


@dataclass(frozen=True)
class NewGoal:
    """A goal (D,) [rad] that is given at a time [s]."""

    time: float
    goal: Array

    def __call__(self, time: float, movement: Movement, robot: Robot) -> None:
        """Gives the command, when it is time."""
        if _same_tick(time, self.time):
            movement.goal = self.goal


@dataclass(frozen=True)
class Held:
    """A joint that is held fast from one time to another [s]."""

    joint: int
    start: float
    end: float

    def __call__(self, time: float, movement: Movement, robot: Robot) -> None:
        """Grips or releases the joint, when it is time."""
        if _same_tick(time, self.start):
            robot.hold(self.joint)
        if _same_tick(time, self.end):
            robot.hold(None)


def _same_tick(one: float, other: float) -> bool:
    return round(one / DT) == round(other / DT)


def drive(
    robot: Robot,
    movement: Movement,
    events: Sequence[NewGoal | Held] = (),
    *,
    feedback: bool = False,
) -> Robot:
    """Drives the robot along a movement until it has settled on its goal.

    Parameters
    ----------
    robot : Robot
        Where the movement starts.
    movement : Movement
        A `pdmp.Controller`, or what else steps like one.
    events : sequence
        What happens on the way.
    feedback : bool
        Tell the movement where the robot is, so that it waits when held.
    """
    status, tick = pdmp.Status.WORKING, 0
    while status == pdmp.Status.WORKING and tick < LONGEST / DT:
        for event in events:
            event(tick * DT, movement, robot)
        status = movement.step(measured=robot.position) if feedback else movement.step()
        robot.move(movement.position, movement.velocity, movement.acceleration)
        tick += 1
    return robot


def reach_over(
    model: pdmp.Model,
    reaching: Reaching,
    height: float,
    style: Array,
    *events: NewGoal | Held,
    tau: float = PACE,
) -> Robot:
    """Reaches over an obstacle of this height [m] from rest, in this style."""
    robot = Robot(reaching.start, reaching.task, boxes(height))
    return drive(robot, from_rest(model, reaching, style, tau), events)


def from_rest(
    model: pdmp.Model, reaching: Reaching, style: Array, tau: float = PACE
) -> pdmp.Controller:
    """Returns a controller that starts with the robot at rest and goes to the goal as printed."""
    return model.controller(
        dt=DT,
        style=style,
        start=reaching.start,
        velocity=np.zeros(model.n_dofs),
        goal=reaching.goal,
        tau=tau,
    )
