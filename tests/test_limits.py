"""Limits of position, velocity and acceleration, in the control loop and along the path."""

import copy
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp import Limits
from synthetic import loops, reaches
from test_forecast import motion, pickled, refuse_forged_states

NAN, INF = float("nan"), float("inf")
BOX = Limits(position=([-0.5, -0.3], [0.6, 0.4]), velocity=[3.0, 2.0], acceleration=[12.0, 9.0])
"""Limits that bind in both models. In a tick of 0.1 s, A changes the velocity by V / 2 at most."""


@dataclass
class Judge:
    """Largest excess over each limit of the ticks so far."""

    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    excess: float = 0.0

    @classmethod
    def of(cls, limits: Limits) -> "Judge":
        """Returns the judge of limits that are all given."""
        assert limits.position is not None
        assert limits.velocity is not None
        assert limits.acceleration is not None
        return cls(*limits.position, limits.velocity, limits.acceleration)

    def tick(self, before: np.ndarray, after: np.ndarray, dt: float) -> None:
        """Compares the end of a tick, and the cubic that leads to it, with the limits."""
        (y, v), (y_end, v_end) = before[:2], after[:2]
        a = (v_end - v) / dt
        r = np.linspace(0, 1, 201)[:, None]
        between = (
            (1 + 2 * r) * (1 - r) ** 2 * y
            + r * (1 - r) ** 2 * dt * v
            + r**2 * (3 - 2 * r) * y_end
            + r**2 * (r - 1) * dt * v_end
        )
        outside = np.maximum(between - self.upper, self.lower - between)
        self.excess = max(self.excess, float((outside / (self.upper - self.lower)).max()))
        self.excess = max(self.excess, float((np.abs(v_end) / self.velocity).max()) - 1)
        self.excess = max(self.excess, float((np.abs(after[2]) / self.acceleration).max()) - 1)
        # A difference of velocities has their rounding errors, per tick.
        rounding = 4 * np.finfo(float).eps * self.velocity / (dt * self.acceleration)
        self.excess = max(self.excess, float((np.abs(a) / self.acceleration - rounding).max()) - 1)


def attack(controller: pdmp.Controller, model: pdmp.Model, seed: int, ticks: int) -> Any:
    """Yields the motion and the length of each tick under hostile commands."""
    random = np.random.default_rng(seed)
    rhythmic = model.kind == "rhythmic"
    for _ in range(ticks):
        kind, vector = (
            random.integers(60),
            random.normal(size=model.n_dofs) * 10 ** random.uniform(-1, 2),
        )
        if kind == 0:
            controller.style = random.normal(size=model.n_styles)
        elif kind == 1:
            setattr(controller, "anchor" if rhythmic else "goal", vector)
        elif kind == 2:
            controller.tau = model.tau * 10 ** random.uniform(-1, 1)
        elif kind == 3:
            controller.speed = random.choice([0.0, 1.0, 3.0])
        elif kind == 4:
            controller.release()
        elif kind == 5 and rhythmic:
            controller.phase = random.uniform(0, 6)
            controller.amplitude = random.uniform(0, 5)
        dt = 10 ** random.uniform(-6, -1) if random.integers(2) else 0.001
        controller.step(
            dt,
            measured=vector if random.integers(40) == 0 else None,
            coupling=(vector, vector) if random.integers(40) == 0 else None,
        )
        yield motion(controller), dt


def n_limited_in_attack(
    controller: pdmp.Controller, model: pdmp.Model, seed: int, ticks: int
) -> int:
    """Asserts that hostile commands exceed no limit; returns the number of limited ticks."""
    assert controller.limits is not None
    judge, before, n_limited = Judge.of(controller.limits), motion(controller), 0
    for after, dt in attack(controller, model, seed, ticks):
        assert np.isfinite(after).all()
        judge.tick(before, after, dt)
        before = after
        n_limited += any(controller.limited)
    assert judge.excess <= 1e-12
    return n_limited


def inside(model: pdmp.Model, limits: Limits, dt: float = 0.001) -> pdmp.Controller:
    """Returns a controller that rests inside the box after its first tick."""
    centre = "anchor" if model.kind == "rhythmic" else "goal"
    controller = model.controller(
        dt, start=[0.0, 0.0], velocity=[0.0, 0.0], limits=limits, **{centre: [0.1, 0.1]}
    )
    controller.step(1e-6)
    return controller


@pytest.mark.parametrize("seed", range(4))
def test_hostile_commands_keep_every_limit_at_ticks_and_turns(model: pdmp.Model, seed: int) -> None:
    """The excess is one of rounding for ticks from 1e-6 to 0.1 s; the motion stays finite."""
    assert n_limited_in_attack(inside(model, BOX), model, seed, 4000) > 400


@pytest.mark.parametrize("seed", range(3))
def test_hostile_commands_keep_a_limit_of_the_jerk(model: pdmp.Model, seed: int) -> None:
    """Position, velocity, acceleration and its change keep their limits at every tick."""
    assert BOX.position is not None
    jerk = np.array([500.0, 80.0])
    limits = Limits(BOX.position, BOX.velocity, BOX.acceleration, jerk)
    controller, (lower, upper) = inside(model, limits), BOX.position
    assert controller.limits == limits
    before, named = motion(controller), set()
    for after, dt in attack(controller, model, seed, 3000):
        assert np.isfinite(after).all()
        assert ((after[0] >= lower - 1e-12) & (after[0] <= upper + 1e-12)).all()
        assert (abs(after[1]) <= np.multiply(BOX.velocity, 1 + 1e-12)).all()
        assert (abs(after[2]) <= np.multiply(BOX.acceleration, 1 + 1e-12)).all()
        assert (abs(after[2] - before[2]) <= jerk * dt + 1e-13).all()
        before = after
        named |= set(controller.limited)
    assert named >= {None, "position", "velocity", "jerk"}


def test_a_movement_with_limited_jerk_starts_without_acceleration(reach: pdmp.Model) -> None:
    """It still finishes at its goal."""
    controller = reach.controller(limits=Limits(acceleration=9.0, jerk=60.0))
    assert not controller.acceleration.any()
    while controller.step():
        assert controller.time < 5
    np.testing.assert_allclose(controller.position, controller.goal, atol=0.01)


@pytest.mark.parametrize("kind", ["discrete", "rhythmic"])
@pytest.mark.parametrize("n_dofs", [1, 5, 9])
def test_random_limits_of_any_number_of_dofs_are_kept(kind: str, n_dofs: int) -> None:
    """Each DoF keeps its own limits, from far apart to close together."""
    random = np.random.default_rng(n_dofs)
    mixing = random.normal(size=(2, n_dofs))
    movements = loops() if kind == "rhythmic" else reaches()
    demos = [pdmp.Demonstration(demo.position @ mixing, dt=0.02) for demo in movements]
    model = pdmp.fit(demos, kind=kind, n_styles=2, basis="ngnet")
    for _ in range(5):
        at_rest = {"start": random.normal(size=n_dofs), "velocity": np.zeros(n_dofs)}
        sides = 10 ** random.uniform(-1.5, 0.5, size=(2, n_dofs))
        position = (at_rest["start"] - sides[0], at_rest["start"] + sides[1])
        velocity = 10 ** random.uniform(-1, 1, size=n_dofs)
        # In a tick of 0.1 s, A changes the velocity by V / 2 and moves by range / 8 at most.
        most = np.minimum(velocity / 0.2, sides.sum(axis=0) / 0.04)
        limits = Limits(position, velocity, most * 10 ** random.uniform(-1, 0, size=n_dofs))
        controller = model.controller(limits=limits, **at_rest)
        controller.step(1e-6)
        assert n_limited_in_attack(controller, model, n_dofs, 500) > 100


@pytest.mark.parametrize("scale", [2.0**-10, 2.0**10])
def test_limits_hold_in_any_unit(scale: float) -> None:
    """A change of the unit by a power of two, which is exact, changes neither motion nor names."""
    demos = [pdmp.Demonstration(scale * demo.position, dt=0.02) for demo in reaches()]
    model = pdmp.fit(demos, n_styles=2, basis="ngnet")
    unit = Limits(velocity=[1.0, 1.0], acceleration=[5.0, 5.0])
    limits = Limits(velocity=[scale, scale], acceleration=[5 * scale, 5 * scale])
    controller = model.controller(0.002, limits=limits, velocity=[0, 0])
    same = pdmp.fit(reaches(), n_styles=2, basis="ngnet").controller(
        0.002, limits=unit, velocity=[0, 0]
    )
    for _ in range(400):
        controller.step()
        same.step()
        assert controller.limited == same.limited
        assert (np.abs(controller.velocity) <= scale).all()
    np.testing.assert_allclose(controller.position / scale, same.position, atol=1e-6)


def test_limits_that_do_not_bind_leave_the_motion_bit_for_bit(model: pdmp.Model) -> None:
    """Under commands of every kind, the motion is that without limits."""
    slack = Limits(([-1e3] * 2, [1e3] * 2), velocity=[1e4] * 2, acceleration=[1e7] * 2)
    free, limited = model.controller(), model.controller(limits=slack)
    random = np.random.default_rng(3)
    for tick in range(1500):
        if tick % 300 == 200:
            vector = random.uniform(-1, 1, size=2)
            for controller in (free, limited):
                setattr(controller, "anchor" if model.kind == "rhythmic" else "goal", vector)
                controller.style = vector
                controller.tau = model.tau * (1 + 0.5 * vector[0])
        measured = 0.1 * random.normal(size=2) if tick % 50 == 0 else None
        statuses = [controller.step(measured=measured) for controller in (free, limited)]
        assert statuses[0] == statuses[1]
        np.testing.assert_array_equal(motion(free), motion(limited))
        assert limited.limited == [None, None]


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"position": ([0, 0], [1, 1, 1])}, "position has 2 lower and 3 upper limits"),
        ({"position": ([0, 0], None), "velocity": [1, 1, 1]}, "position: lower has length 2"),
        ({"position": (None, [[1.0]])}, r"position: upper has shape \[1, 1\]"),
    ],
)
def test_errors_of_positions_name_the_argument(limits: dict[str, Any], message: str) -> None:
    """The two parts of `position` have no names in Python."""
    with pytest.raises(ValueError, match=message):
        pdmp.Limits(**limits)


def test_a_restart_in_a_pause_brakes_within_the_limits(reach: pdmp.Model) -> None:
    """Position and velocity given to `reset` at speed 0 stay continuous, and the robot stops."""
    dt, limits = 0.001, pdmp.Limits(velocity=2.0, acceleration=10.0)
    controller = reach.controller(dt, limits=limits)
    for _ in range(400):
        controller.step()
    controller.speed = 0.0
    for _ in range(20):
        controller.step()
    velocity = controller.velocity.copy()
    assert abs(velocity).max() > 0.1
    controller.reset(start=controller.position.copy(), velocity=velocity)
    np.testing.assert_allclose(controller.velocity, velocity, rtol=1e-12)
    for _ in range(1000):
        controller.step()
        assert (abs(controller.velocity - velocity) <= 10.0 * dt * (1 + 1e-9)).all()
        velocity = controller.velocity.copy()
    assert (velocity == 0).all()


def test_a_goal_outside_is_approached_up_to_the_limit(reach: pdmp.Model) -> None:
    """The goal is the nearest point inside, and the movement finishes there."""
    limits = Limits(([-1.0, -1.0], [0.7, 1.0]), acceleration=[20.0, 20.0])
    controller = reach.controller(limits=limits)
    controller.goal = [5.0, 0.1]
    np.testing.assert_array_equal(controller.goal, [0.7, 0.1])
    while controller.step():
        assert controller.position[0] <= 0.7
        assert controller.time < 20
    np.testing.assert_allclose(controller.position, [0.7, 0.1], atol=0.01)
    controller.limits = None
    controller.goal = [5.0, 0.1]
    np.testing.assert_array_equal(controller.goal, [5.0, 0.1])


def test_a_start_outside_returns_within_the_acceleration(model: pdmp.Model) -> None:
    """It brakes with at most A, comes inside and stays; the DoF is reported as limited."""
    limits = Limits(([-0.2, -0.2], [0.2, 0.2]), acceleration=[10.0, 10.0])
    centre = "anchor" if model.kind == "rhythmic" else "goal"
    controller = model.controller(limits=limits, start=[0.5, 0.0], velocity=[1.0, 0.0])
    setattr(controller, centre, [0.1, 0.0])
    velocity, entered = np.array(controller.velocity), False
    for tick in range(5000):
        controller.step()
        if tick == 0:
            assert controller.limited[0] is not None
        assert (np.abs(controller.velocity - velocity) <= 10 * 0.001 * (1 + 1e-9)).all()
        velocity = np.array(controller.velocity)
        is_inside = (np.abs(controller.position) <= 0.2).all()
        assert is_inside or not entered
        entered |= bool(is_inside)
    assert entered


def test_limits_that_shrink_on_line_are_reached_by_braking(model: pdmp.Model) -> None:
    """The acceleration keeps its limit meanwhile; wider limits are in force at once."""
    controller = inside(model, BOX)
    for _ in attack(controller, model, 11, 300):
        pass
    controller.speed = 1.0
    small = Limits(([-0.1, -0.1], [0.2, 0.2]), velocity=[0.3, 0.3], acceleration=[12.0, 9.0])
    controller.limits = small
    velocity = np.array(controller.velocity)
    for tick in range(3000):
        controller.step(0.001)
        change = np.abs(controller.velocity - velocity)
        assert (change <= np.multiply(0.001, [12.0, 9.0]) * (1 + 1e-9)).all()
        velocity = np.array(controller.velocity)
        if tick > 2000:
            assert (np.abs(velocity) <= 0.3).all()
            assert (controller.position >= -0.1).all()
            assert (controller.position <= 0.2).all()
    controller.limits = BOX
    assert controller.limits == BOX
    controller.limits = None
    assert controller.limits is None


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, pickled])
def test_a_copy_keeps_the_limits_and_continues_identically(
    model: pdmp.Model, duplicate: Callable[[pdmp.Controller], pdmp.Controller]
) -> None:
    """Also when it is copied while limits bind."""
    controller = inside(model, BOX)
    for _ in attack(controller, model, 5, 400):
        if any(controller.limited) and controller.time > 1:
            break
    assert any(controller.limited)
    twin = duplicate(controller)
    assert twin.limits == BOX
    assert twin.limited == controller.limited
    expected = [after for after, _ in attack(controller, model, 6, 300)]
    np.testing.assert_array_equal([after for after, _ in attack(twin, model, 6, 300)], expected)
    assert any(controller.limited) == any(twin.limited)


def test_a_forecast_keeps_the_limits(model: pdmp.Model) -> None:
    """It is the future of the loop to the bit."""
    controller = inside(model, BOX)
    for _ in attack(controller, model, 8, 200):
        pass
    controller.release()
    controller.step(0.001)
    forecast = controller.forecast(0.5)
    judge = Judge.of(BOX)
    before, limited = motion(controller), 0
    for k in range(1, len(forecast.time)):
        controller.step()
        after = np.stack([forecast.position[k], forecast.velocity[k], forecast.acceleration[k]])
        np.testing.assert_array_equal(motion(controller), after)
        judge.tick(before, after, controller.dt)
        before = after
        limited += any(controller.limited)
    assert judge.excess <= 1e-12
    assert limited > 0


def test_limits_stay_in_force_after_a_reset(model: pdmp.Model) -> None:
    """A new movement is limited like the first."""
    controller = model.controller(limits=BOX)
    first = [controller.step() and motion(controller) for _ in range(300)]
    controller.reset()
    assert controller.limits == BOX
    np.testing.assert_array_equal(
        [controller.step() and motion(controller) for _ in range(300)], first
    )


def test_limits_of_one_number_are_those_of_all_dofs(model: pdmp.Model) -> None:
    """Scalars and arrays give the same motion; the controller returns arrays."""
    one = model.controller(limits=Limits(position=(-0.5, 0.5), velocity=1.0, acceleration=9.0))
    each = Limits(([-0.5, -0.5], [0.5, 0.5]), velocity=[1.0, 1.0], acceleration=[9.0, 9.0])
    assert one.limits == each
    other = model.controller(limits=each)
    for _ in range(300):
        one.step()
        other.step()
        np.testing.assert_array_equal(motion(one), motion(other))


@pytest.mark.parametrize("name", ["velocity", "acceleration", "position"])
def test_each_limit_alone_is_kept_and_named(model: pdmp.Model, name: str) -> None:
    """A DoF is free, or limited by the limit that is given."""
    limits = {
        "position": Limits(([-0.3, -0.1], [0.3, 0.1])),
        "velocity": Limits(velocity=[0.5, 0.5]),
        "acceleration": Limits(acceleration=[4.0, 4.0]),
    }[name]
    controller = model.controller(limits=limits, start=[0.0, 0.0], velocity=[0.0, 0.0])
    named = set()
    for _ in range(2000):
        velocity = np.array(controller.velocity)
        controller.step()
        named |= set(controller.limited)
        if name == "velocity":
            assert (np.abs(controller.velocity) <= 0.5).all()
        elif name == "position":
            assert (np.abs(controller.position) <= [0.3, 0.1]).all()
        else:
            change = np.abs(controller.velocity - velocity)
            assert (change <= 4.0 * 0.001 * (1 + 1e-9)).all()
    assert named == {None, name}


SETTERS: list[tuple[str, Any]] = [
    ("style", [1.0, -1.0]),
    ("tau", 0.2),
    ("speed", 0.0),
    ("compliance", (1.0, 50.0)),
    ("limits", Limits(([-0.4, -0.2], [0.5, 0.3]), velocity=[1.0, 1.0], acceleration=[9.0, 9.0])),
    ("limits", Limits(acceleration=[9.0, 9.0], jerk=[100.0, 100.0])),
    ("goal", [3.0, -3.0]),
    ("goal_velocity", [3.0, -3.0]),
    ("anchor", [3.0, -3.0]),
    ("amplitude", 3.0),
    ("phase", 2.0),
    ("release", None),
]


@pytest.mark.parametrize(("name", "value"), SETTERS, ids=[name for name, _ in SETTERS])
def test_a_command_between_ticks_leaves_the_limited_motion(
    reach: pdmp.Model, cycle: pdmp.Model, name: str, value: Any
) -> None:
    """Position and velocity are those of the last tick, and the next tick changes them within A."""
    only = {"goal": [reach], "goal_velocity": [reach]}
    only |= dict.fromkeys(("anchor", "amplitude", "phase"), [cycle])
    for model in only.get(name, [reach, cycle]):
        check_that_no_motion_changes(model, name, value)


def check_that_no_motion_changes(model: pdmp.Model, name: str, value: Any) -> None:
    """Sets a property between many ticks at which limits bind."""
    controller = inside(model, BOX)
    for k, _ in enumerate(attack(controller, model, 8, 600)):
        if k % 3:
            continue
        twin = copy.copy(controller)
        before = motion(twin)
        twin.release() if name == "release" else setattr(twin, name, value)
        np.testing.assert_array_equal(motion(twin)[:2], before[:2])
        twin.step(0.001)
        change = np.abs(twin.velocity - before[1])
        assert (change <= np.multiply(0.001, [12.0, 9.0]) * (1 + 1e-9)).all()


EXCESS = 5e-3
"""Largest excess of the time law over its limits, which it imposes at samples of the path."""
TIMED: list[dict[str, Any]] = [
    {},
    {"goal": [0.7, 0.4]},
    {"goal": [-0.5, 0.2], "start": [0.3, 0.3]},
    {"context": [0.13], "tau": 3.0},
]
RATES = [
    Limits(velocity=2.0, acceleration=8.0),
    Limits(velocity=[0.5, 2.0]),
    Limits(acceleration=[3.0, 1.0]),
]


@pytest.mark.parametrize("limits", RATES, ids=repr)
@pytest.mark.parametrize("conditions", TIMED, ids=repr)
def test_the_fastest_tau_is_exact(
    reach: pdmp.Model, limits: Limits, conditions: dict[str, Any]
) -> None:
    """With it, the largest velocity or acceleration equals its limit."""
    tau = reach.fastest_tau(limits, **conditions)
    movement = reach.rollout(dt=tau / 2000, **(conditions | {"tau": tau}))
    assert use(movement, limits) == pytest.approx(1.0, rel=2e-3)


def use(movement: pdmp.Trajectory, limits: Limits) -> float:
    """Returns the largest share of the limits of velocity and acceleration that a movement uses."""
    velocity = 0.0 if limits.velocity is None else (abs(movement.velocity) / limits.velocity).max()
    if limits.acceleration is None:
        return float(velocity)
    return float(max(velocity, (abs(movement.acceleration) / limits.acceleration).max()))


@pytest.mark.parametrize("limits", RATES, ids=repr)
@pytest.mark.parametrize("conditions", TIMED, ids=repr)
def test_the_fastest_movement_keeps_its_limits_and_its_path(
    reach: pdmp.Model, limits: Limits, conditions: dict[str, Any]
) -> None:
    """No constant tau is faster; the positions lie on the path of a rollout, and end at its end."""
    dt = 1e-3
    fastest = reach.fastest(limits, dt=dt, **conditions)
    tau = reach.fastest_tau(limits, **conditions)
    # The last sample is the first at or after the end.
    assert fastest.time[-1] <= tau + dt
    assert use(fastest, limits) <= 1 + EXCESS
    np.testing.assert_allclose(fastest.velocity[[0, -1]], 0.0, atol=1e-6)
    slow = reach.rollout(dt=1e-4, **(conditions | {"tau": 1.0}))
    gaps = np.linalg.norm(fastest.position[:, None] - slow.position[None, ::10], axis=2).min(axis=1)
    assert gaps.max() < 2e-3
    np.testing.assert_allclose(fastest.position[-1], slow.position[-1], atol=1e-3)
    if limits.acceleration is not None:
        # The trapezoidal rule is exact for constant acceleration.
        steps = 0.5 * dt * (fastest.velocity[1:] + fastest.velocity[:-1])
        np.testing.assert_allclose(np.diff(fastest.position, axis=0), steps, atol=1e-5)


def test_the_fastest_movement_uses_a_limit_almost_always(reach: pdmp.Model) -> None:
    """A time-optimal movement has a DoF at its limit at almost every instant."""
    limits = Limits(velocity=1.5, acceleration=8.0)
    fastest = reach.fastest(limits, dt=1e-3)
    share = np.maximum(abs(fastest.velocity) / 1.5, abs(fastest.acceleration) / 8.0).max(axis=1)
    assert (share > 0.98).mean() > 0.95


def test_a_fastest_movement_starts_and_ends_with_given_velocities(reach: pdmp.Model) -> None:
    """A velocity at the start is that of the conditions."""
    limits = Limits(velocity=[3.0, 3.0], acceleration=[30.0, 30.0])
    velocity = 0.5 * reach.rollout(dt=0.01).velocity[10]
    fastest = reach.fastest(limits, velocity=velocity, dt=1e-3)
    np.testing.assert_allclose(fastest.velocity[0], velocity, rtol=1e-6)
    assert use(fastest, limits) <= 1 + EXCESS


def test_a_start_too_fast_for_a_fastest_movement_is_refused(reach: pdmp.Model) -> None:
    """The error is that of a bad argument, and names it."""
    velocity = 0.5 * reach.rollout(dt=0.01).velocity[10]
    with pytest.raises(ValueError, match="velocity: .* times too fast"):
        reach.fastest(Limits(velocity=1e-3), velocity=velocity)


def test_limits_print_compare_and_pickle() -> None:
    """The representation is a call that makes equal limits."""
    for limits in (
        Limits(),
        Limits(position=(-1, 2)),
        Limits(position=(None, [1.0, 2.5])),
        Limits(position=([0.0, -1.0], None), acceleration=3),
        Limits((-2.9, 2.9), 2.0, [8.0, 10.0]),
        Limits(acceleration=[8.0, 10.0], jerk=500.0),
    ):
        assert eval(repr(limits)) == limits
        for twin in (pickle.loads(pickle.dumps(limits)), copy.copy(limits), copy.deepcopy(limits)):
            assert twin == limits
            assert repr(twin) == repr(limits)
    assert Limits(velocity=1) != Limits(velocity=2)
    assert Limits(velocity=1) != 1
    assert Limits(acceleration=1, jerk=2) != Limits(acceleration=1)
    assert repr(Limits(acceleration=1, jerk=2)) == "pdmp.Limits(acceleration=[1.0], jerk=[2.0])"
    assert (
        repr(Limits((-1, None), velocity=2))
        == "pdmp.Limits(position=([-1.0], None), velocity=[2.0])"
    )
    assert Limits(position=(None, 2)).position == ([-INF], [2.0])
    with pytest.raises(ValueError, match="read-only"):
        Limits(velocity=2).velocity[0] = 3  # type: ignore[index]
    with pytest.raises(AttributeError):
        Limits().velocity = 3  # type: ignore[misc, assignment]


WRONG: list[tuple[Callable[[pdmp.Model], Any], str]] = [
    (lambda m: Limits(velocity=0), "velocity = 0: every limit must be positive"),
    (lambda m: Limits(acceleration=1, jerk=0), "jerk = 0: every limit must be positive"),
    (
        lambda m: Limits(velocity=1, jerk=50),
        "limits of DoF 0: a jerk of 50 needs a limit of the acceleration, .*; give both",
    ),
    (
        lambda m: Limits(position=(0, 1e200)),
        r"position: upper\[0\] = 1e200: magnitudes above 1e150",
    ),
    (lambda m: Limits(velocity=[1, -1]), "velocity = -1: every limit must be positive"),
    (lambda m: Limits(acceleration=-INF), "acceleration = -inf: every limit must be positive"),
    (lambda m: Limits(velocity=NAN), r"velocity\[0\] = NaN"),
    (lambda m: Limits(position=(0, [1, NAN])), r"position: upper\[1\] = NaN"),
    (lambda m: Limits(position=(1, 1)), "limits of DoF 0: the lower limit 1 must be below"),
    (lambda m: Limits(position=(0, [1, -1])), "limits of DoF 1: the lower limit 0 must be below"),
    (lambda m: Limits(position=(INF, None)), "limits of DoF 0: the lower limit inf must be below"),
    (lambda m: Limits(velocity="fast"), "velocity has dtype"),
    (lambda m: Limits(position=("a", "b")), "position: lower has dtype"),
    (lambda m: Limits(velocity=[]), "velocity has length 0, expected 1"),
    (lambda m: Limits(velocity=[[1]]), r"velocity has shape \[1, 1\]"),
    (
        lambda m: Limits(velocity=[1, 2], acceleration=[1, 2, 3]),
        "velocity has length 2, expected 3",
    ),
    (lambda m: m.controller(limits=Limits(velocity=[1] * 3)), "velocity has length 3, expected 2"),
    (lambda m: m.fastest(Limits(velocity=[1] * 3)), "velocity has length 3, expected 2"),
    (lambda m: m.fastest_tau(Limits(velocity=[1] * 3)), "velocity has length 3, expected 2"),
    (lambda m: m.fastest(Limits((-1, 1))), "limits bound neither velocity nor acceleration"),
    (lambda m: m.fastest_tau(Limits()), "limits bound neither velocity nor acceleration"),
    (
        lambda m: m.fastest(Limits((-0.1, 0.1), velocity=1)),
        "limits of DoF 0: the path reaches 0.1.* outside -0.1 to 0.1; change goal or style",
    ),
    (lambda m: m.fastest(Limits(velocity=1), dt=0), "dt = 0: must be positive"),
    (lambda m: m.fastest(Limits(velocity=1), dt=1e-12), "dt = 1e-12: gives more than"),
    (lambda m: m.fastest(Limits(velocity=1), style=[1]), "style has length 1, expected 2"),
]


@pytest.mark.parametrize(("call", "message"), WRONG, ids=[text for _, text in WRONG])
def test_wrong_limits_are_named_in_one_line(
    reach: pdmp.Model, call: Callable[[pdmp.Model], Any], message: str
) -> None:
    """The error names the limit, its value and the values allowed."""
    with pytest.raises(ValueError, match=f"^{message}") as error:
        call(reach)
    assert "\n" not in str(error.value)


TYPES: list[tuple[Callable[[pdmp.Model], Any], str]] = [
    (lambda m: Limits(position=3), r"position = 3: expected two limits \(lower, upper\)"),  # type: ignore[arg-type]
    (lambda m: Limits(position=(1, 2, 3)), r"position = \(1, 2, 3\): expected two limits"),  # type: ignore[arg-type]
    (lambda m: m.controller(limits=3), "limits = 3: expected pdmp.Limits"),  # type: ignore[arg-type]
    (
        lambda m: setattr(m.controller(), "limits", (0, 1)),
        r"limits = \(0, 1\): expected pdmp.Limits",
    ),
    (lambda m: m.fastest(None), "limits = None: expected pdmp.Limits"),  # type: ignore[arg-type]
    (lambda m: m.fastest_tau({}), "limits = {}: expected pdmp.Limits"),  # type: ignore[arg-type]
]


@pytest.mark.parametrize(("call", "message"), TYPES, ids=[text for _, text in TYPES])
def test_limits_of_another_type_are_rejected_by_name(
    reach: pdmp.Model, call: Callable[[pdmp.Model], Any], message: str
) -> None:
    """The error is one line with the argument, its value and the expected type."""
    with pytest.raises(TypeError, match=f"^{message}") as error:
        call(reach)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("dt", [5e-324, 1e-310, 1e-300, 1e-100, 1e-20])
def test_ticks_of_any_length_keep_the_motion_finite(model: pdmp.Model, dt: float) -> None:
    """The reciprocal of the shortest ticks overflows."""
    controller = model.controller(0.01, limits=Limits(velocity=0.5, acceleration=5.0))
    for length in [*[0.01] * 20, dt, dt, 0.001, 0.001]:
        controller.step(length)
        assert np.isfinite(motion(controller)).all()
        assert np.isfinite(controller.phase)


def test_forged_states_with_limits_are_rejected_or_keep_finite(reach: pdmp.Model) -> None:
    """Every forged number is refused, or leaves a controller that moves by finite numbers."""
    controller = inside(reach, BOX)
    for _ in attack(controller, reach, 5, 100):
        pass
    refuse_forged_states(controller, [NAN, INF, -INF, -1e300, 1e300, 0.0, -1.0])


def test_rejected_limits_leave_the_present_ones_in_force(model: pdmp.Model) -> None:
    """The motion continues to the bit as if nothing had been set."""
    controller = inside(model, BOX)
    twin = copy.copy(controller)
    for wrong in (Limits(velocity=[1.0] * 3), Limits(acceleration=[1e9] * 3)):
        with pytest.raises(ValueError, match="has length 3, expected 2"):
            controller.limits = wrong
        assert controller.limits == BOX
    for _ in range(200):
        controller.step()
        twin.step()
        np.testing.assert_array_equal(motion(controller), motion(twin))


def test_a_rhythmic_movement_has_no_fastest_form(cycle: pdmp.Model) -> None:
    """It has no end."""
    for call in (cycle.fastest, cycle.fastest_tau):
        with pytest.raises(ValueError, match="does not apply to a rhythmic primitive"):
            call(Limits(velocity=1.0))
