"""Control loop at 1 kHz, which steps a movement and drives the robot along it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import pdmp
from reproduction.reaching import Reaching
from reproduction.robot import Robot, boxes
from reproduction.torques import DT

Array = NDArray[np.float64]

TAU = 0.6  # s, time constant on the robot, as printed; twice that of the fit
MAX_DURATION = 30.0  # s
TOLERANCE = 1e-3  # of the range of each joint, below 1 mm of the hand


class Movement(Protocol):
    """Interface of a controller in the loop."""

    goal: Any

    def step(self, *, measured: Array | None = None) -> pdmp.Status:
        """Steps by one tick."""

    @property
    def position(self) -> Array: ...  # noqa: D102
    @property
    def velocity(self) -> Array: ...  # noqa: D102
    @property
    def acceleration(self) -> Array: ...  # noqa: D102


@dataclass(frozen=True)
class NewGoal:
    """Command of a new goal (D,) [rad] at a time [s]."""

    time: float
    goal: Array

    def __call__(self, time: float, movement: Movement, robot: Robot) -> None:
        """Sets the goal at its time."""
        if _same_tick(time, self.time):
            movement.goal = self.goal


@dataclass(frozen=True)
class JointLock:
    """Disturbance: a joint is locked from one time to another [s]."""

    joint: int
    start: float
    end: float

    def __call__(self, time: float, movement: Movement, robot: Robot) -> None:
        """Locks or releases the joint at its time."""
        if _same_tick(time, self.start):
            robot.hold(self.joint)
        if _same_tick(time, self.end):
            robot.hold(None)


def _same_tick(one: float, other: float) -> bool:
    return round(one / DT) == round(other / DT)


def drive(
    robot: Robot,
    movement: Movement,
    events: Sequence[NewGoal | JointLock] = (),
    *,
    feedback: bool = False,
) -> Robot:
    """Drives the robot along a movement until it has settled at its goal.

    Parameters
    ----------
    robot : Robot
        Robot at the start of the movement.
    movement : Movement
        A `pdmp.Controller`, or an object with the same interface.
    events : sequence
        Commands and disturbances during the movement.
    feedback : bool
        Pass the measured position to the movement, which slows its phase when the robot is blocked.
    """
    status, tick = pdmp.Status.WORKING, 0
    while status == pdmp.Status.WORKING and tick < MAX_DURATION / DT:
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
    *events: NewGoal | JointLock,
    tau: float = TAU,
    limits: pdmp.Limits | None = None,
) -> Robot:
    """Drives the robot from rest over an obstacle of this height [m] with a style."""
    robot = Robot(reaching.start, reaching.task, boxes(height))
    return drive(robot, from_rest(model, reaching, style, tau, limits), events)


def from_rest(
    model: pdmp.Model,
    reaching: Reaching,
    style: Array,
    tau: float = TAU,
    limits: pdmp.Limits | None = None,
) -> pdmp.Controller:
    """Returns a controller that starts with the robot at rest and moves to the printed goal."""
    controller = model.controller(
        dt=DT,
        limits=limits,
        style=style,
        start=reaching.start,
        velocity=np.zeros(model.n_dofs),
        goal=reaching.goal,
        tau=tau,
    )
    controller.tolerance = TOLERANCE
    return controller
