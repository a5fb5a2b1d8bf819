"""Conditions of movements: of demonstrations, their means and blends."""

import copy
import pickle
from typing import Any

import numpy as np
import pandas
import pytest

import pdmp
from synthetic import loops, reaches


@pytest.mark.parametrize("m", range(5))
def test_rollout_of_demonstrated_conditions_gives_the_demonstration_back(m: int) -> None:
    """With J = M, the conditions of a demonstration reproduce it."""
    demos = reaches()
    model = pdmp.fit(demos, n_styles=5)
    made = model.rollout(model.conditions(m), dt=0.02)
    np.testing.assert_allclose(made.position, demos[m].position, atol=1e-3)


def test_rhythmic_rollout_of_demonstrated_conditions_gives_the_cycle_back() -> None:
    """A rhythmic primitive reproduces its demonstration from the first tick on."""
    demos = loops()
    model = pdmp.fit(demos, kind="rhythmic", n_styles=2)
    made = model.rollout(model.conditions(1), dt=0.02)
    np.testing.assert_allclose(made.position[:-1], demos[1].position, atol=1e-2)


def test_several_demonstrations_give_their_mean() -> None:
    """Conditions of several demonstrations are their mean."""
    model = pdmp.fit(reaches())
    mean = model.conditions([0, 1])
    np.testing.assert_allclose(mean.goal, model.goals[:2].mean(axis=0))
    np.testing.assert_allclose(mean.style, model.styles[:2].mean(axis=0))


def test_blend_ends_at_both() -> None:
    """A share of 0 is the first, 1 the second, a half the mean."""
    a = pdmp.Conditions(style=[0.0, 1.0], tau=1.0)
    b = pdmp.Conditions(style=[2.0, 1.0], tau=3.0)
    for share, expected in ((0, [0, 1]), (1, [2, 1]), (0.5, [1, 1])):
        np.testing.assert_array_equal(pdmp.blend(a, b, share).style, expected)
    assert pdmp.blend(a, b, 0.5).tau == 2.0


@pytest.mark.parametrize("demos", [1.0, None, "1", [[0, 1], [1, 0]]])
def test_index_is_a_whole_number(demos: Any) -> None:
    """An invalid index is quoted in the error."""
    with pytest.raises(ValueError, match="demos = .*: pass the index of a demonstration"):
        pdmp.fit(reaches()).conditions(demos)


def test_blend_rejects_unequal_lengths_and_shares_that_are_not_finite() -> None:
    """Conditions of unequal lengths and a share that is not finite are rejected by name."""
    one, two = pdmp.Conditions(style=[1.0]), pdmp.Conditions(style=[1.0, 2.0])
    with pytest.raises(ValueError, match="style has length 2, expected 1"):
        pdmp.blend(one, two, 0.5)
    with pytest.raises(ValueError, match="share = NaN: must be finite"):
        pdmp.blend(one, one, float("nan"))


def test_blend_rejects_a_condition_that_one_lacks() -> None:
    """A condition that only one of the two has is named."""
    with pytest.raises(ValueError, match="goal: given for some of the conditions only"):
        pdmp.blend(pdmp.Conditions(style=[1.0]), pdmp.Conditions(style=[1.0], goal=[0.0]), 0.5)


@pytest.mark.parametrize("demos", [-1, 5, [0, 7], []])
def test_unknown_demonstration_is_rejected(demos: int | list[int]) -> None:
    """An index outside the demonstrations is rejected with the range."""
    with pytest.raises(ValueError, match=r"between 0 and 4|at least one"):
        pdmp.fit(reaches()).conditions(demos)


def test_keywords_replace_single_conditions() -> None:
    """A keyword replaces the condition of its name, and the others stay."""
    model = pdmp.fit(reaches())
    conditions = model.conditions(2)
    moved = model.rollout(conditions, goal=model.goals[0] + 0.1)
    expected = model.rollout(conditions.replace(goal=model.goals[0] + 0.1))
    np.testing.assert_array_equal(moved.position, expected.position)
    slower = conditions.replace(tau=2 * model.tau)
    assert slower.tau == 2 * model.tau and slower.segment_durations is None
    assert slower.replace(segment_durations=[1.0]).tau is None


@pytest.mark.parametrize("how", ["rollout", "controller", "jacobian"])
def test_invalid_conditions_are_rejected_by_name(how: str) -> None:
    """Unknown keywords, values that are not numbers and other objects are named."""
    model = pdmp.fit(reaches())
    first = ["style"] if how == "jacobian" else []
    call = lambda *given, **changes: getattr(model, how)(*first, *given, **changes)  # noqa: E731
    with pytest.raises(TypeError, match="unexpected keyword argument 'gaol'; conditions are style"):
        call(gaol=[0.0, 0.0])
    with pytest.raises(ValueError, match=r"tau = \[1, 2\]: expected one number"):
        call(tau=[1, 2])
    with pytest.raises(ValueError, match="tau = 'slow': expected one number"):
        call(tau="slow")
    if how != "controller":
        with pytest.raises(TypeError, match=r"conditions = \[0.1, 0.2\]: expected pdmp.Conditions"):
            call([0.1, 0.2])


def test_final_velocity_is_a_condition() -> None:
    """It is blended, replaced and reset as the other conditions; demonstrations have none."""
    model = pdmp.fit(reaches())
    plain = model.conditions(1)
    assert plain.goal_velocity is None
    strike = plain.replace(goal_velocity=[2.0, -0.4])
    assert strike != plain and strike.replace(goal_velocity=None) == plain
    half = pdmp.blend(strike, strike.replace(goal_velocity=[0.0, 0.0]), 0.5)
    np.testing.assert_array_equal(half.goal_velocity, [1.0, -0.2])
    with pytest.raises(ValueError, match="goal_velocity: given for some of the conditions only"):
        pdmp.blend(strike, plain, 0.5)
    made = model.rollout(strike)
    np.testing.assert_array_equal(
        made.position, model.rollout(plain, goal_velocity=[2.0, -0.4]).position
    )
    controller = model.controller(0.001)
    for conditions in (strike, plain):
        controller.reset(conditions)
        np.testing.assert_array_equal(controller.goal_velocity, conditions.goal_velocity)


def test_tolerance_is_kept_by_reset_and_copies() -> None:
    """The tolerance, 0.005 by default, belongs to the controller and not to a movement."""
    controller = pdmp.fit(reaches()).controller(0.001)
    assert controller.tolerance == 0.005
    controller.tolerance = 1e-4
    controller.reset()
    assert (controller.tolerance, copy.copy(controller).tolerance) == (1e-4, 1e-4)


def test_conditions_are_values() -> None:
    """Conditions compare by value, survive pickling, and print their values."""
    conditions = pdmp.Conditions(goal=np.array([0.5, 1.0]), amplitude=np.float64(0.5))
    assert pickle.loads(pickle.dumps(conditions)) == conditions
    assert conditions != conditions.replace(tau=1)
    assert repr(conditions) == "pdmp.Conditions(goal=[0.5, 1.0], amplitude=0.5)"
    assert eval(repr(conditions)) == conditions


def test_conditions_of_the_other_kind_are_rejected_everywhere() -> None:
    """Rollout, controller and reset reject an amplitude or final velocity of the other kind."""
    model = pdmp.fit(reaches())
    controller = model.controller(0.01)
    for call in (model.rollout, model.controller, controller.reset):
        with pytest.raises(ValueError, match="amplitude"):
            call(amplitude=1.0)
    model = pdmp.fit(loops(), kind="rhythmic")
    for call in (model.rollout, model.controller, model.controller(0.01).reset):
        with pytest.raises(ValueError, match="goal_velocity"):
            call(goal_velocity=[0.0, 0.0])


@pytest.mark.parametrize("kind", ["series", "dict"])
def test_named_elements_of_a_condition_are_put_into_the_order_of_the_model(kind: str) -> None:
    """A row of a data frame or a mapping has any order; other names are refused."""
    demos = [pdmp.Demonstration(demo.position, dt=demo.dt, names=["x", "y"]) for demo in reaches()]
    model = pdmp.fit(demos)
    make = pandas.Series if kind == "series" else dict
    expected = model.rollout(goal=[1.1, 0.2], start=[0.1, 0.0], velocity=[0.0, 0.3])
    named = {
        "goal": make({"y": 0.2, "x": 1.1}),
        "start": make({"x": 0.1, "y": 0.0}),
        "velocity": make({"y": 0.3, "x": 0.0}),
    }
    np.testing.assert_array_equal(model.rollout(**named).position, expected.position)
    controller = model.controller(0.01, goal=make({"y": 0.2, "x": 1.1}))
    np.testing.assert_array_equal(controller.goal, [1.1, 0.2])
    with pytest.raises(ValueError, match="goal has elements z, y, expected one for each of x, y"):
        model.rollout(goal=make({"z": 0.2, "y": 1.1}))
    with pytest.raises(ValueError, match="goal has elements y, expected one for each of x, y"):
        model.rollout(goal=make({"y": 0.2}))


def test_names_are_followed_wherever_conditions_meet_a_model() -> None:
    """Commands, batches and goals of demonstrations too; conditions by themselves refuse names."""
    demos = [
        pdmp.Demonstration(
            demo.position, dt=demo.dt, names=["x", "y"], goal=pandas.Series({"y": 0.5, "x": 1.0})
        )
        for demo in reaches()
    ]
    np.testing.assert_array_equal(demos[0].goal, [1.0, 0.5])
    model = pdmp.fit(demos)
    controller = model.controller(0.01)
    controller.goal = pandas.Series({"y": 0.2, "x": 1.1})
    np.testing.assert_array_equal(controller.goal, [1.1, 0.2])
    goals = pandas.DataFrame({"y": [0.1, 0.2], "x": [0.9, 1.1]})
    batch = model.rollouts(goal=goals, dt=0.01)[0]
    expected = model.rollout(goal=[1.1, 0.2], dt=0.01).position
    np.testing.assert_allclose(batch[1], expected, atol=1e-12)
    with pytest.raises(ValueError, match="goal has names, which conditions alone cannot"):
        pdmp.Conditions(goal=goals.iloc[0])
    unnamed = model.rollout(goal=pandas.Series([1.1, 0.2]), dt=0.01).position
    np.testing.assert_array_equal(unnamed, expected)
