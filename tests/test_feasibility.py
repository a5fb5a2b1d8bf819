"""Comparison of movements with limits, and the nearest conditions that keep them."""

import pickle

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.optimize import nnls

import pdmp
from pdmp import Limits
from synthetic import loops, reaches
from test_real_data import raised_hands


def duration(model: pdmp.Model) -> float:
    """Returns the duration or period of the nominal movement in s."""
    return float(model.durations[model.nominal])


def share(model: pdmp.Model, part: float, conditions: pdmp.Conditions | None = None) -> Limits:
    """Returns limits at a part of the extremes of a movement, by default the nominal one."""
    movement = model.rollout(conditions, dt=duration(model) / 2000)
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
    assert not margins
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
    assert margins
    assert (margins.position, margins.velocity, margins.acceleration) == (None, None, None)


def test_margins_are_pickled(model: pdmp.Model) -> None:
    """Margins survive pickling, and equal margins compare equal."""
    margins = model.feasible(Limits(velocity=2.0))
    assert pickle.loads(pickle.dumps(margins)) == margins
    assert margins != model.feasible(Limits(velocity=1.0))
    assert "velocity" in repr(margins)


def until_rest(model: pdmp.Model, conditions: pdmp.Conditions) -> pdmp.Trajectory:
    """Returns a movement until it rests, or a period, on a grid ten times finer than the search."""
    n_durations = 3 if model.kind == "discrete" else 1
    span = duration(model)
    return model.rollout(conditions, dt=span / 20000, duration=n_durations * span)


@pytest.mark.parametrize("part", [0.97, 0.9])
def test_nearest_conditions_keep_the_limits(model: pdmp.Model, part: float) -> None:
    """The result keeps the limits between the samples of the program, and nothing else changes."""
    limits = share(model, part)
    near = model.nearest_feasible(limits)
    assert model.feasible(limits, near)
    assert use(limits, until_rest(model, near)).max() < 1 + 2e-9
    rest = near.replace(style=None, goal=None, anchor=None)
    assert rest == pdmp.Conditions()


def use(limits: Limits, movement: pdmp.Trajectory) -> np.ndarray:
    """Returns the shares of the limits of velocity and acceleration that a movement uses."""
    assert limits.velocity is not None
    assert limits.acceleration is not None
    velocity, acceleration = movement.velocity, movement.acceleration
    parts = [velocity / limits.velocity, acceleration / limits.acceleration]
    return np.concatenate([sign * part.ravel() for part in parts for sign in (1, -1)])


def centre_name(model: pdmp.Model) -> str:
    """Returns the name of the condition about which a movement takes place."""
    return "goal" if model.kind == "discrete" else "anchor"


def deviations(model: pdmp.Model) -> np.ndarray:
    """Returns a root of the covariance of the demonstrated styles and goals, or anchors."""
    centres = model.goals if model.kind == "discrete" else model.anchors
    demos = reaches() if model.kind == "discrete" else loops()
    ranges = np.max([np.ptp(demo.position, axis=0) for demo in demos], axis=0)
    blocks = []
    largest = np.full(model.n_styles, abs(model.styles).max())
    for rows, sizes in ((model.styles, largest), (centres, ranges)):
        covariance = np.atleast_2d(np.cov(rows, rowvar=False))
        blocks.append(np.linalg.cholesky(covariance + np.diag((0.1 * sizes) ** 2)))
    return np.asarray(block_diag(*blocks))


def nearest_by_nnls(
    model: pdmp.Model, limits: Limits, request: pdmp.Conditions, root: np.ndarray
) -> float:
    """Returns the length of the shortest change, in units of `root`, that keeps all samples inside.

    Least distance programming by non-negative least squares: Lawson, Hanson, Solving Least Squares
    Problems, chapter 23. The constraints are those of every sample of rollouts.
    """
    name = centre_name(model)

    def uses(change: np.ndarray) -> np.ndarray:
        style, centre = np.split(change, [model.n_styles])
        changes = {"style": request.style + style, name: getattr(request, name) + centre}
        dt = duration(model) / 2000
        return use(limits, model.rollout(request.replace(**changes), dt=dt))

    inside = uses(np.zeros(len(root)))
    gradients = np.stack([uses(column) - inside for column in root.T], axis=1)
    # min |x| subject to -gradients x >= inside - 1.
    least, most = -gradients, inside - 1
    stacked = np.vstack([least.T, most])
    target = np.append(np.zeros(len(root)), 1.0)
    solution, _ = nnls(stacked, target, maxiter=10000)
    residual = stacked @ solution - target
    return float(np.linalg.norm(residual[:-1] / residual[-1]))


@pytest.mark.parametrize("part", [0.98, 0.9, 0.7])
def test_no_other_program_finds_nearer_conditions(model: pdmp.Model, part: float) -> None:
    """The distance is that of least distance programming over all samples of rollouts."""
    name = centre_name(model)
    request = model.conditions(1).replace(start=None, segment_durations=None)
    limits = share(model, part)
    near = model.nearest_feasible(limits, request)
    change = [near.style - request.style, getattr(near, name) - getattr(request, name)]
    root = deviations(model)
    found = float(np.linalg.norm(np.linalg.solve(root, np.concatenate(change))))
    assert found > 0.01
    assert found == pytest.approx(nearest_by_nnls(model, limits, request, root), rel=1e-4)


@pytest.mark.parametrize("part", [0.5, 0.05, 0.005])
@pytest.mark.parametrize("scale", [[1.0, 1.0], [1e-3, 1e3], [1e5, 1.0]])
def test_movements_from_rest_can_keep_any_limits_in_any_units(
    part: float, scale: list[float]
) -> None:
    """Resting at the start is feasible, so that no request is refused."""
    demos = [pdmp.Demonstration(scale * demo.position, dt=0.02) for demo in reaches()]
    model = pdmp.fit(demos, n_styles=2, basis="ngnet")
    # The nominal movement hardly moves the second DoF, this one does.
    request = model.conditions(1)
    limits = share(model, part, request)
    assert model.feasible(limits, model.nearest_feasible(limits, request))


def test_feasible_requests_are_unchanged(model: pdmp.Model) -> None:
    """Conditions inside the limits are returned bit for bit, absent ones absent."""
    limits = share(model, 1.01)
    for conditions in (pdmp.Conditions(), pdmp.Conditions(style=model.styles[model.nominal])):
        assert model.nearest_feasible(limits, conditions) == conditions


def test_predictions_can_be_asked_to_stay_inside(reach: pdmp.Model) -> None:
    """Style and goal change; the other attributes describe the prediction without limits."""
    free = reach.predict([0.2])
    top = until_rest(reach, free.conditions).position[:, 1].max()
    limits = Limits(position=(-10, [10.0, 0.9 * top]))
    inside = reach.predict([0.2], limits=limits)
    assert reach.feasible(limits, inside.conditions)
    assert until_rest(reach, inside.conditions).position[:, 1].max() <= 0.9 * top + 1e-9
    changed = {"style": free.conditions.style, "goal": free.conditions.goal}
    assert inside.conditions.replace(**changed) == free.conditions
    np.testing.assert_array_equal(inside.covariance, free.covariance)
    assert inside.duration == free.duration
    assert reach.nearest_feasible(limits, context=[0.2]) == inside.conditions
    assert reach.predict([0.2], limits=Limits(velocity=1e3)).conditions == free.conditions
    moved = reach.nearest_feasible(limits, context=[0.2], start=[0.1, 0.0])
    assert reach.feasible(limits, moved)
    assert list(moved.start) == [0.1, 0.0]
    with pytest.raises(TypeError, match=r"limits = 3: expected pdmp\.Limits"):
        reach.predict([0.2], limits=3)  # type: ignore[arg-type]


def test_contexts_outside_the_demonstrations_stay_inside_or_raise(reach: pdmp.Model) -> None:
    """However far away the context is."""
    limits = Limits(position=(-0.5, 1.5), velocity=4.0, acceleration=60.0)
    met = 0
    for distance in 10.0 ** np.arange(-1, 9):
        try:
            inside = reach.predict([distance], limits=limits).conditions
        except ValueError as error:
            assert "limits of DoF" in str(error) or "context" in str(error)
        else:
            assert reach.feasible(limits, inside)
            met += 1
    assert met > 1


def test_impossible_limits_raise_one_error_with_a_remedy(model: pdmp.Model) -> None:
    """The error names limit, degree of freedom, numbers and remedy."""
    with pytest.raises(
        ValueError,
        match=r"DoF \d: no change of (goal|anchor) .* reaches .* or vary both, or let .* last \d",
    ):
        model.nearest_feasible(share(model, 0.2), vary="goal")
    with pytest.raises(ValueError, match="vary = 'pace': must be"):
        model.nearest_feasible(Limits(), vary="pace")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="velocity has length 3"):
        model.feasible(Limits(velocity=[1.0, 2.0, 3.0]))


@pytest.mark.parametrize("part", [0.95, 0.7])
def test_raised_hands_keep_limits_between_samples(part: float) -> None:
    """Joint movements of people, learnt by a process, keep tighter limits until they rest."""
    model = pdmp.fit(raised_hands())
    request = model.conditions(1).replace(segment_durations=None)
    movement = until_rest(model, request)
    limits = Limits(
        position=(movement.position.min(0) - 0.02, movement.position.max(0) + 0.02),
        velocity=part * abs(movement.velocity).max(0),
        acceleration=part * abs(movement.acceleration).max(0),
    )
    near = model.nearest_feasible(limits, request)
    moved = until_rest(model, near)
    assert use(limits, moved).max() < 1 + 2e-9
    assert limits.position is not None
    lower, upper = limits.position
    assert (
        np.maximum(moved.position - upper, lower - moved.position) <= 2e-9 * (upper - lower)
    ).all()
    assert (
        np.ptp(moved.position - movement.position, axis=0) < np.ptp(movement.position, axis=0)
    ).all()
