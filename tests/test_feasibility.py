"""Comparison of movements with limits, and the nearest conditions that keep them."""

import pickle

import numpy as np
import pytest

import pdmp
from pdmp import Limits


def duration(model: pdmp.Model) -> float:
    """Returns the duration or period of the nominal movement in s."""
    return float(model.durations[model.nominal])


def share(model: pdmp.Model, part: float) -> Limits:
    """Returns limits at a part of the extremes of the nominal movement."""
    movement = model.rollout(dt=duration(model) / 2000)
    return Limits(
        velocity=part * abs(movement.velocity).max(0),
        acceleration=part * abs(movement.acceleration).max(0),
    )


def test_margins_are_the_extremes_of_a_finer_rollout(model: pdmp.Model) -> None:
    """Ratio, degree of freedom and time are those of the extremes."""
    movement = model.rollout(dt=duration(model) / 20000)
    top = movement.position.max(0)
    limits = Limits(position=(-10.0, top - 0.1), velocity=2.0, acceleration=3.0)
    margins = model.feasible(limits)
    assert not margins.feasible
    for place, values, limit in (
        (margins.velocity, movement.velocity, 2.0),
        (margins.acceleration, movement.acceleration, 3.0),
    ):
        assert place is not None
        ratio, dof, time = place
        assert ratio == pytest.approx(abs(values).max() / limit, rel=1e-4)
        sample = int(np.argmin(abs(movement.time - time)))
        assert abs(values[sample, dof]) == pytest.approx(abs(values).max(), rel=1e-4)
    assert margins.position is not None
    assert margins.position[0] == pytest.approx((0.1 / (top + 9.9)).max(), rel=1e-4)


def test_margins_of_absent_limits_are_none(model: pdmp.Model) -> None:
    """Without limits every movement is feasible."""
    margins = model.feasible(Limits())
    assert margins.feasible
    assert (margins.position, margins.velocity, margins.acceleration) == (None, None, None)


def test_margins_are_pickled(model: pdmp.Model) -> None:
    """Margins survive pickling, and equal margins compare equal."""
    margins = model.feasible(Limits(velocity=2.0))
    assert pickle.loads(pickle.dumps(margins)) == margins
    assert margins != model.feasible(Limits(velocity=1.0))
    assert "velocity" in repr(margins)


@pytest.mark.parametrize("part", [0.97, 0.9])
def test_nearest_conditions_keep_the_limits(model: pdmp.Model, part: float) -> None:
    """The result keeps the limits between the samples of the program, and nothing else changes."""
    limits = share(model, part)
    assert limits.velocity is not None
    assert limits.acceleration is not None
    near = model.nearest_feasible(limits)
    assert model.feasible(limits, near).feasible
    movement = model.rollout(near, dt=duration(model) / 20000)
    assert (abs(movement.velocity) / limits.velocity).max() < 1 + 1e-4
    assert (abs(movement.acceleration) / limits.acceleration).max() < 1 + 1e-4
    rest = near.replace(style=None, goal=None, anchor=None)
    assert rest == pdmp.Conditions()


def test_feasible_requests_are_unchanged(model: pdmp.Model) -> None:
    """Conditions inside the limits are returned bit for bit, absent ones absent."""
    limits = share(model, 1.01)
    for conditions in (pdmp.Conditions(), pdmp.Conditions(style=model.styles[model.nominal])):
        assert model.nearest_feasible(limits, conditions) == conditions


def test_requests_by_context_are_met(reach: pdmp.Model) -> None:
    """The conditions of a context, with their segment durations, are changed like any others."""
    predicted = reach.predict([0.2]).conditions
    movement = reach.rollout(predicted, dt=0.001)
    limits = Limits(position=(-10, [10.0, 0.9 * movement.position[:, 1].max()]))
    near = reach.nearest_feasible(limits, context=[0.2])
    assert reach.rollout(near, dt=0.001).position[:, 1].max() <= limits.position[1][1] + 1e-4  # type: ignore[index]
    assert near == reach.nearest_feasible(limits, predicted)
    assert near.replace(style=predicted.style, goal=predicted.goal) == predicted


def test_impossible_limits_raise_one_error_with_a_remedy(model: pdmp.Model) -> None:
    """The error names limit, degree of freedom, numbers and remedy."""
    with pytest.raises(ValueError, match=r"limits of DoF \d.*velocity reaches.*enlarge tau"):
        model.nearest_feasible(share(model, 0.2), vary="goal")
    with pytest.raises(ValueError, match="vary = 'pace': must be"):
        model.nearest_feasible(Limits(), vary="pace")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="velocity has length 3"):
        model.feasible(Limits(velocity=[1.0, 2.0, 3.0]))
