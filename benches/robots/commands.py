"""Random commands to a simulated robot, and what was commanded and measured."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

import pdmp
from reproduction.torques import DT, TorqueControlled
from robots.arms import Arms

INTERVAL = 1.0  # s, mean time between two commands
COMMANDS = ("goal", "style", "tau", "speed", "start", "hold")
BEYOND = 0.2  # of the joint range, beyond either limit, from which goals are drawn too
TAU = (0.3, 2.0)  # times that of the model
PAUSED = 0.2  # share of the commanded speeds that are zero
MAX_SPEED = 2.0
HOLD = (0.1, 0.8)  # s, of one joint
RECOVERY = 1.0  # s after its release in which the joint returns to its command


@dataclass
class Record:
    """Motion of a run, a row per tick, and its counts.

    Attributes
    ----------
    position, velocity, measured : (T, D) array
        Commands and measured joint angles [rad, rad/s, rad].
    limited : (T,) array of bool
        Ticks in which a limit slowed the movement down or determined the motion of a joint.
    pending : (T,) array of bool
        Ticks in which a part of a command waits, as the limits would not be kept with it.
    held : (T,) array of bool
        Ticks in which a joint is held or returns after its release.
    saturated : (T,) array of bool
        Ticks in which a motor was at its limit.
    commands : Counter
        Number of commands of each kind; "start" counts the movements.
    """

    position: np.ndarray
    velocity: np.ndarray
    measured: np.ndarray
    limited: np.ndarray
    pending: np.ndarray
    held: np.ndarray
    saturated: np.ndarray
    commands: Counter = field(default_factory=Counter)

    @classmethod
    def empty(cls, n_ticks: int, n_dofs: int) -> "Record":
        """Returns a record without ticks."""
        rows, flags = np.zeros((3, n_ticks, n_dofs)), np.zeros((4, n_ticks), dtype=bool)
        return cls(*rows, *flags)


class Hostile:
    """Random commands to a controller and a robot.

    Parameters
    ----------
    controller : pdmp.Controller
        Controller; a movement that has finished is followed by another one from where it is.
    model : pdmp.Model
        Its model.
    robot : TorqueControlled
        Robot, one of whose joints is held at times.
    arms : Arms
        Joint range.
    random : numpy.random.Generator
        Source of the commands.
    """

    def __init__(
        self,
        controller: pdmp.Controller,
        model: pdmp.Model,
        robot: TorqueControlled,
        arms: Arms,
        random: np.random.Generator,
    ) -> None:
        self.controller, self.model, self.robot, self.random = controller, model, robot, random
        lower, upper = arms.limits.position
        margin = BEYOND * (upper - lower)
        self.goals = lower - margin, upper + margin
        self.spread = model.styles.std(axis=0)
        self.counts: Counter = Counter()
        self.next = 0.0  # s
        self.held, self.released = False, -np.inf  # s, end of the present or last hold

    def goal(self) -> np.ndarray:
        """Returns a goal (D,) inside or outside the limits."""
        return self.random.uniform(*self.goals)

    def style(self) -> np.ndarray:
        """Returns a style (J,), half of them those of demonstrations."""
        if self.random.integers(2):
            return self.random.choice(self.model.styles)
        return 2 * self.spread * self.random.normal(size=self.model.n_styles)

    def tau(self) -> float:
        """Returns a time constant [s]."""
        return float(self.model.tau * np.exp(self.random.uniform(*np.log(TAU))))

    def speed(self) -> float:
        """Returns a relative speed, or a pause."""
        paused = self.random.random() < PAUSED
        return 0.0 if paused else float(self.random.uniform(0, MAX_SPEED))

    def start(self) -> None:
        """Starts another movement from where the present one is, with its velocity."""
        controller = self.controller
        here = {"start": controller.position, "velocity": controller.velocity}
        controller.speed = 1.0  # to which the velocity at the start refers
        controller.reset(goal=self.goal(), style=self.style(), tau=self.tau(), **here)
        self.counts["start"] += 1

    def __call__(self, time: float) -> bool:
        """Gives the commands of this time [s]; returns whether a joint is held or returns."""
        controller = self.controller
        if controller.status == pdmp.Status.FINISHED:
            self.start()
        if self.held and time >= self.released:
            self.held = False
            self.robot.hold(None)
        if time >= self.next:
            self.next = time + self.random.exponential(INTERVAL)
            kind = self.random.choice(COMMANDS)
            if kind == "start":
                self.start()
            elif kind == "hold":
                self.held = True
                self.robot.hold(int(self.random.integers(self.model.n_dofs)))
                self.released = time + self.random.uniform(*HOLD)
                self.counts["hold"] += 1
            else:
                setattr(controller, kind, getattr(self, kind)())
                self.counts[str(kind)] += 1
        return time < self.released + RECOVERY


def run(
    arms: Arms, model: pdmp.Model, seconds: float, seed: int, limits: pdmp.Limits | None
) -> Record:
    """Drives a robot at 1 kHz by random commands, its measured position fed back.

    Parameters
    ----------
    arms : Arms
        Robot.
    model : pdmp.Model
        Primitive of its joints.
    seconds : float
        Simulated time.
    seed : int
        Seed of the commands.
    limits : pdmp.Limits or None
        Limits of the controller.
    """
    lower, upper = arms.limits.position
    start = 0.5 * (lower + upper)
    at_rest = {"start": start, "velocity": np.zeros(model.n_dofs)}
    controller = model.controller(DT, limits=limits, **at_rest)
    robot = arms.simulated(start)
    hostile = Hostile(controller, model, robot, arms, np.random.default_rng(seed))
    n_ticks = round(seconds / DT)
    record = Record.empty(n_ticks, model.n_dofs)
    for tick in range(n_ticks):
        record.held[tick] = hostile(tick * DT)
        controller.step(measured=robot.position)
        robot.move(controller.position, controller.velocity, controller.acceleration)
        record.position[tick] = controller.position
        record.velocity[tick] = controller.velocity
        record.measured[tick] = robot.position
        record.limited[tick] = any(controller.limited)
        record.pending[tick] = controller.pending
        record.saturated[tick] = robot.saturated
    record.commands = hostile.counts
    return record
