"""Simulated robots under random commands stay within their limits, and follow."""

from dataclasses import dataclass

import numpy as np
import pytest

import pdmp
from pdmp.robots import REGISTRY
from robots.arms import ROBOTS, Arms
from robots.commands import Record, run
from robots.excess import Excess, excess, turns
from robots.pictures import JOINTS, NEW_GOAL, commanded
from synthetic import reaches

SECONDS = 30.0
SEED = 1


@dataclass(frozen=True)
class Runs:
    """Figures of the same commands with and without limits."""

    kept: Excess
    free: Excess


@pytest.fixture(scope="module", params=ROBOTS)
def arms(request: pytest.FixtureRequest) -> Arms:
    """Returns a robot, or skips without MuJoCo and the model of the robot."""
    arms = ROBOTS[request.param]()
    try:
        arms.simulated(np.mean(arms.limits.position, axis=0))
    except ImportError as reason:
        pytest.skip(str(reason))
    return arms


@pytest.fixture(scope="module")
def runs(arms: Arms) -> Runs:
    """Returns the figures of both runs of a robot, with a primitive of reaches."""
    mixing = np.random.default_rng(SEED).normal(size=(2, len(arms.joints)))
    model = arms.fit([pdmp.Demonstration(demo.position @ mixing, dt=0.02) for demo in reaches()])
    kept, free = (
        excess(run(arms, model, SECONDS, SEED, limits), arms.limits)
        for limits in (arms.limits, None)
    )
    return Runs(kept, free)


def test_no_command_exceeds_a_limit(runs: Runs) -> None:
    """The excess of positions, velocities and accelerations is one of rounding."""
    assert runs.kept.n_commands > 5
    assert runs.kept.position <= 1e-12
    assert runs.kept.velocity <= 1 + 1e-12
    # A difference of velocities over a tick of 1 ms has a thousand times their rounding errors.
    assert runs.kept.acceleration <= 1 + 1e-11
    assert 0.01 < runs.kept.limited < 1


def test_the_same_commands_exceed_the_limits_of_a_controller_without_them(runs: Runs) -> None:
    """The commands leave the limits by far, unless they are kept."""
    assert runs.free.position > 0.02
    assert runs.free.velocity > 1.2
    assert runs.free.acceleration > 2
    assert runs.free.limited == 0


def test_robots_follow_limited_commands(runs: Runs) -> None:
    """The error is one of a tick as a rule; without limits the motors cannot follow at all."""
    assert runs.kept.median < 2e-3
    assert runs.kept.worst < 0.1 < 0.5 < runs.free.worst
    assert runs.kept.saturated < runs.free.saturated


def test_the_drawn_command_ends_at_the_limit_and_at_its_goal() -> None:
    """The goal of one joint is beyond its limit, that of the other one inside."""
    limits = REGISTRY["panda"].limits(JOINTS)
    for kept, expected in ((None, NEW_GOAL), (limits, [limits.position[1][0], NEW_GOAL[1]])):
        _, position, *_ = commanded(kept)
        np.testing.assert_allclose(position[-1], expected, atol=2e-3)


def test_turns_between_ticks_count() -> None:
    """Between two ticks at one position, a joint that turns round is farther out."""
    record = Record.empty(3, 2)
    record.velocity[:] = [[1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]]
    record.position[:, 1] = [0.0, -0.001, -0.001]
    # On the parabola of the first joint, the turn is 1² / (2 · 2 / 0.001) away.
    np.testing.assert_allclose(turns(record), [[0.00025, -0.001], [0.0, -0.00125]], atol=1e-15)


def test_demonstrations_are_mapped_into_the_joint_range(arms: Arms) -> None:
    """Demonstrations take up the middle of the range; small ones keep their size."""
    lower, upper = arms.limits.position
    n_dofs = len(arms.joints)
    ramp = np.linspace(0, 1, 50)[:, None]
    for size, expected in ((0.1, np.full(n_dofs, 0.1)), (20.0, 0.8 * (upper - lower))):
        model = arms.fit([pdmp.Demonstration(size * ramp * np.ones(n_dofs), dt=0.02)] * 2)
        np.testing.assert_allclose(model.goals[0] - model.starts[0], expected, rtol=1e-6)
        middle = 0.5 * (model.goals[0] + model.starts[0])
        np.testing.assert_allclose(middle, 0.5 * (lower + upper), atol=1e-6)
