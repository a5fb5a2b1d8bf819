"""Comparison with the other methods that the paper discusses, on the same task and robot.

- a DMP of one demonstration, of which only goal and time constant can change;
- principal components of the joint trajectories about their mean, J of them,
  replayed in time, in place of the models of trajectories that the paper mentions;
- a library of demonstrations from which a new DMP is fitted for every height, by locally weighted
  regression (Gams, Ude, IEEE-RAS International Conference on Humanoid Robots, 2009, 28-33).

All learn from the nine reaches over zero, two and three boxes; one and four boxes are the tests.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

import pdmp
from pdmp._markdown import markdown_table
from pdmp.plot.canvas import BLUE, GREY, ORANGE, label_axes, legend, new_figure
from reproduction.heights import (
    N_SAMPLES,
    TESTED,
    aligned,
    learn,
    new_goal,
    predicted_style,
    robot_duration,
)
from reproduction.loop import TAU, JointLock, Movement, NewGoal, drive, from_rest
from reproduction.reaching import (
    CONSTANTS,
    TRAINING_HEIGHTS,
    Reaching,
    demonstrate,
    duration_of,
    height_of,
)
from reproduction.robot import Robot, boxes, pile
from reproduction.section import SEED, Section
from reproduction.torques import DT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[Any]  # of float64
Rival: TypeAlias = Callable[[Reaching], Callable[[float], Movement]]
"""Method: a function from reaches to a generator of movements for a height [m]."""

N_STYLES = 3
WIDTH = 0.45  # m, kernel width of the library: the range of the demonstrated heights
LOCKED_JOINT, LOCK_DURATION = 3, 0.5  # index of the elbow; s
LOCK_AT = 0.3  # of the demonstrated duration


def styles(reaching: Reaching) -> Callable[[float], Movement]:
    """Fits one primitive with three style parameters, predicted from the height."""
    model = learn(reaching, N_STYLES)
    return lambda height: from_rest(model, reaching, predicted_style(model, height))


def one_demonstration(reaching: Reaching) -> Callable[[float], Movement]:
    """Fits a DMP to the demonstration of median duration."""
    nominal = learn(reaching, N_STYLES).nominal
    model = pdmp.fit([reaching.of(TRAINING_HEIGHTS)[nominal]], n_styles=1, **CONSTANTS)
    return lambda height: from_rest(model, reaching, model.styles[0])


def library(reaching: Reaching) -> Callable[[float], Movement]:
    """Stores all demonstrations, and fits a DMP for each height to those of similar heights.

    The target is linear in the trajectory: weighted regression of all targets equals regression of
    their weighted mean; the kernel is (1 − (|h − hᵐ|/width)³)³.
    """
    paths, heights, duration = _training_reaches(reaching)

    def synthesise(height: float) -> Movement:
        near = np.clip(1 - (np.abs(heights - height) / WIDTH) ** 3, 0, None) ** 3
        mean = np.tensordot(near / near.sum(), paths, axes=1)
        model = pdmp.fit([mean], dt=duration / (N_SAMPLES - 1), n_styles=1, **CONSTANTS)
        return from_rest(model, reaching, model.styles[0])

    return synthesise


@dataclass
class Recording:
    """A trajectory that is replayed in time; commands, such as `goal`, have no effect."""

    trajectory: Array  # (3, T, 4): joint angles [rad], their velocities and accelerations
    goal: Array
    tick: int = 0

    def __post_init__(self) -> None:  # noqa: D105
        self.position, self.velocity, self.acceleration = self.trajectory[:, 0]

    def step(self, *, measured: Array | None = None) -> pdmp.Status:
        """Advances to the next sample, or stays at the last."""
        last = self.trajectory.shape[1] - 1
        self.tick = min(self.tick + 1, last)
        self.position, self.velocity, self.acceleration = self.trajectory[:, self.tick]
        return pdmp.Status.FINISHED if self.tick == last else pdmp.Status.WORKING


def components(reaching: Reaching) -> Callable[[float], Movement]:
    """Computes principal components of the trajectories, weighted by the height."""
    from scipy.interpolate import CubicSpline

    paths, heights, duration = _training_reaches(reaching)
    duration *= TAU / CONSTANTS["tau"]
    flat = paths.reshape(len(paths), -1)
    mean = flat.mean(axis=0)
    factors = pdmp.factorise(flat - mean, n_styles=N_STYLES)
    chosen = pdmp.ContextMap(heights[:, None], factors.styles, "linear")

    def play(height: float) -> Movement:
        weights = chosen.predict([[height]])[0][0]
        path = (mean + weights @ factors.basis_targets).reshape(N_SAMPLES, -1)
        spline = CubicSpline(np.linspace(0, duration, N_SAMPLES), path, bc_type="clamped")
        # A recording does not wait for the robot; it stays at its last sample.
        times = np.minimum(np.arange(0, duration + 1.0, DT), duration)
        moving = (times < duration)[:, None]
        rows = [spline(times), moving * spline(times, 1), moving * spline(times, 2)]
        return Recording(np.array(rows), reaching.goal)

    return play


RIVALS: dict[str, Rival] = {
    "PDMP, J = 3": styles,
    "DMP of one demonstration": one_demonstration,
    "principal components, 3": components,
    "library of DMPs": library,
}


@dataclass(frozen=True)
class TrialResult:
    """Result of a method at one height: undisturbed, with a moved goal, with a locked joint."""

    alone: Robot
    moved: Robot
    locked: Robot
    lock: JointLock
    new_style: float
    """Median time to compute the movement for a height, ready for its first tick [ms]."""

    def speed_ratio(self) -> float:
        """Returns the maximum joint speed after the release over the undisturbed maximum."""
        return _fastest(self.locked, after=self.lock.end) / _fastest(self.alone)


def disturbances(reaching: Reaching) -> tuple[NewGoal, JointLock]:
    """Returns the disturbances, a moved goal and a locked elbow, at times of the primitive."""
    model = learn(reaching, N_STYLES)
    start = LOCK_AT * robot_duration(model)
    return new_goal(model, reaching), JointLock(LOCKED_JOINT, start, start + LOCK_DURATION)


def run_trial(
    rival: Rival, reaching: Reaching, height: float, command: NewGoal, lock: JointLock
) -> TrialResult:
    """Runs one method over a height [m]."""
    movement_for = rival(reaching)
    times = []
    for _ in range(21):
        began = perf_counter()
        movement_for(height)
        times.append(1e3 * (perf_counter() - began))

    def run(*events: NewGoal | JointLock, feedback: bool = False) -> Robot:
        movement = movement_for(height)
        robot = Robot(movement.position, reaching.task, boxes(height))
        return drive(robot, movement, events, feedback=feedback)

    return TrialResult(run(), run(command), run(lock, feedback=True), lock, float(np.median(times)))


def comparison(seed: int = SEED) -> Section:
    """Compares the methods that the paper compares verbally."""
    reaching = demonstrate(seed)
    command, lock = disturbances(reaching)
    trials = {
        (name, height): run_trial(rival, reaching, height, command, lock)
        for name, rival in RIVALS.items()
        for height in TESTED
    }
    rows = [
        [
            name,
            pile(height),
            f"{trial.alone.log.contact():.3f} s",
            f"{reaching.miss(trial.alone.log.hands[-1]):.1f} mm",
            f"{reaching.miss(trial.moved.log.hands[-1], command.goal):.1f} mm",
            f"{trial.speed_ratio():.1f}",
            f"{trial.locked.log.contact():.3f} s",
            f"{trial.new_style:.2f} ms",
        ]
        for (name, height), trial in trials.items()
    ]
    header = [
        "",
        "over",
        "contact with boxes",
        "distance to the goal",
        "distance to a moved goal",
        "speed after the release",
        "contact with the lock",
        "time for a new style",
    ]
    text = [
        "All methods learn from reaches over zero, two and three boxes. The elbow is locked for "
        "half a second during the movement; the speed after the release is the maximum of all "
        "joints over that of the undisturbed movement. Primitives receive the measured position "
        "and slow down; components cannot. A run ends after 30 s.",
        markdown_table(header, rows),
    ]
    locked = {name: trials[name, TESTED[0]] for name in ("PDMP, J = 3", "principal components, 3")}
    return Section("Comparison with other methods", text, {"held": draw_locked(locked)})


def draw_locked(trials: dict[str, TrialResult]) -> Figure:
    """Draws commanded and measured elbow angle during the lock and after it."""
    figure = new_figure(9.5, 3.8)
    panels = figure.subplots(1, len(trials), sharey=True)
    for axes, (name, trial) in zip(panels, trials.items(), strict=True):
        commanded, done = (rows[:, LOCKED_JOINT] for rows in trial.locked.log.rows())
        time = DT * np.arange(1, len(commanded) + 1)
        within = time < trial.lock.end + 3.0
        axes.axvspan(trial.lock.start, trial.lock.end, color=ORANGE, alpha=0.2, label="locked")
        undisturbed = trial.alone.log.rows()[0][: within.sum(), LOCKED_JOINT]
        axes.plot(time[: len(undisturbed)], undisturbed, "k:", linewidth=1, label="undisturbed")
        axes.plot(time[within], commanded[within], color=GREY, linewidth=3, label="commanded")
        axes.plot(time[within], done[within], color=BLUE, label="measured")
        label_axes(axes, "time [s]", "q4 [rad]", name)
    legend(panels[0])
    return figure


def _fastest(robot: Robot, after: float = 0.0) -> float:
    """Returns the maximum joint speed from a time on [rad/s]."""
    _, done = robot.log.rows()
    return float(np.abs(np.diff(done[round(after / DT) :], axis=0)).max() / DT)


def _training_reaches(reaching: Reaching) -> tuple[Array, Array, float]:
    """Returns the training reaches (M, N, D), their heights (M,) [m], and their median duration."""
    demos = reaching.of(TRAINING_HEIGHTS)
    paths = np.array([aligned(demo) for demo in demos])
    heights = np.array([height_of(demo) for demo in demos])
    return paths, heights, float(np.median([duration_of(demo) for demo in demos]))
