"""Invalid arguments of movements are rejected; in the loop they leave the state unchanged."""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pdmp
from synthetic import loops, reaches

NAN, INF = float("nan"), float("inf")


@pytest.fixture(scope="module")
def discrete() -> pdmp.Model:
    """Returns a model of reaches with two styles and one context value."""
    return pdmp.fit(reaches(), n_styles=2)


@pytest.fixture(scope="module")
def rhythmic() -> pdmp.Model:
    """Returns a model of loops with two styles and no context."""
    return pdmp.fit(loops(), kind="rhythmic", n_styles=2)


SHARED: list[tuple[dict[str, Any], str]] = [
    ({"style": [1]}, "style has length 1, expected 2: one value per style dimension"),
    ({"style": [[1, 2]]}, r"style has shape \[1, 2\], expected one axis"),
    ({"style": 1.0}, r"style = 1.0, expected one axis: a list or array of numbers"),
    ({"style": [NAN, 0]}, r"style\[0\] = NaN: every number must be finite"),
    ({"style": [0, 1e200]}, r"style\[.*1\] = 1e200: magnitudes above .* overflow"),
    ({"style": ["a", "b"]}, "style has dtype"),
    ({"style": [1j, 0]}, "style has dtype"),
    ({"start": [1]}, "start has length 1, expected 2: one value per DoF"),
    ({"start": [0, INF]}, r"start\[1\] = inf"),
    ({"velocity": [1, 2, 3]}, "velocity has length 3, expected 2: one value per DoF"),
    ({"velocity": [NAN, 0]}, r"velocity\[0\] = NaN"),
    ({"tau": 0.0}, "tau = 0: must be positive and finite"),
    ({"tau": -1.0}, "tau = -1: must be positive and finite"),
    ({"tau": NAN}, "tau = NaN: must be positive and finite"),
    ({"tau": INF}, "tau = inf: must be positive and finite"),
    ({"tau": 1e-9}, "tau = .*: must lie within a millionfold"),
    ({"dt": 0.0}, "dt = 0: must be positive and finite"),
    ({"dt": -0.1}, "dt = -0.1: must be positive and finite"),
    ({"dt": NAN}, "dt = NaN: must be positive and finite"),
]
DISCRETE: list[tuple[dict[str, Any], str]] = [
    *SHARED,
    ({"goal": [1]}, "goal has length 1, expected 2: one value per DoF"),
    ({"goal": [NAN, 0]}, r"goal\[0\] = NaN"),
    ({"goal": [0, 1e200]}, r"goal\[.*1\] = 1e200: magnitudes above 1e150 overflow"),
    ({"goal_velocity": [1]}, "goal_velocity has length 1, expected 2: one value per DoF"),
    ({"goal_velocity": [[1, 2]]}, r"goal_velocity has shape \[1, 2\], expected one axis"),
    ({"goal_velocity": [0, NAN]}, r"goal_velocity\[1\] = NaN: every number must be finite"),
    ({"goal_velocity": [1e200, 0]}, r"goal_velocity\[.*0\] = 1e200: magnitudes above .* overflow"),
    ({"anchor": [0, 0]}, "anchor does not apply to a discrete primitive: .*; set goal"),
    ({"amplitude": 1.1}, "amplitude does not apply to a discrete primitive"),
    ({"context": [1, 2]}, "context has length 2, expected 1: one value per context value"),
    ({"context": [NAN]}, r"context\[0\] = NaN"),
    ({"context": [1e300]}, r"context\[0\] = 1e300: magnitudes above 1e150"),
    ({"context": [0], "style": [0, 0]}, "pass style or context, not both"),
]
RHYTHMIC: list[tuple[dict[str, Any], str]] = [
    *SHARED,
    ({"anchor": [1]}, "anchor has length 1, expected 2: one value per DoF"),
    ({"anchor": [NAN, 0]}, r"anchor\[0\] = NaN"),
    ({"goal": [0, 0]}, "goal does not apply to a rhythmic primitive: .*; set anchor"),
    ({"goal_velocity": [0, 0]}, "goal_velocity does not apply to a rhythmic primitive"),
    ({"amplitude": -1.0}, "amplitude = -1: must lie between 0, which is rest, and 1e150"),
    ({"amplitude": NAN}, "amplitude = NaN"),
    (
        {"context": [1]},
        "context does not apply: the model has no context map; fit it with contexts",
    ),
]


@pytest.mark.parametrize(("given", "message"), DISCRETE, ids=str)
@pytest.mark.parametrize("call", [pdmp.Model.rollout, pdmp.Model.controller])
def test_invalid_conditions_are_rejected(
    discrete: pdmp.Model, call: Callable[..., Any], given: dict[str, Any], message: str
) -> None:
    """Rollouts and controllers report the argument and the number that they reject."""
    with pytest.raises(ValueError, match=message):
        call(discrete, **given)


@pytest.mark.parametrize(("given", "message"), RHYTHMIC, ids=str)
@pytest.mark.parametrize("call", [pdmp.Model.rollout, pdmp.Model.controller])
def test_invalid_conditions_of_a_rhythmic_one_are_rejected(
    rhythmic: pdmp.Model, call: Callable[..., Any], given: dict[str, Any], message: str
) -> None:
    """Rhythmic primitives report the argument and the number that they reject."""
    with pytest.raises(ValueError, match=message):
        call(rhythmic, **given)


def test_final_velocity_needs_learnt_transport() -> None:
    """With the paper's transport no frame could pass the goal, as the error states."""
    model = pdmp.fit(reaches(), transport="immediate")
    for call in (model.rollout, model.controller, model.controller().reset):
        with pytest.raises(ValueError, match="goal_velocity needs learnt transport"):
            call(goal_velocity=[0.0, 0.0])
    controller = model.controller()
    with pytest.raises(ValueError, match="goal_velocity needs learnt transport"):
        controller.goal_velocity = [0.0, 0.0]
    assert controller.goal_velocity is None


@pytest.mark.parametrize("duration", [-1.0, NAN, INF])
def test_impossible_durations_are_rejected(discrete: pdmp.Model, duration: float) -> None:
    """A duration must be finite and not negative."""
    with pytest.raises(ValueError, match="duration = "):
        discrete.rollout(duration=duration)


@pytest.mark.parametrize("dt", [1e-300, 1e-12])
def test_rollouts_of_too_many_samples_are_rejected_in_one_line(
    discrete: pdmp.Model, dt: float
) -> None:
    """Too short an interval is rejected before memory is allocated, with a readable number."""
    with pytest.raises(ValueError, match="dt = .*: gives more than 1e7 samples: enlarge it") as e:
        discrete.rollout(dt=dt)
    assert len(str(e.value)) < 120


@pytest.mark.parametrize("goal", [1.0, None, [[1.0, 2.0]]])
def test_a_command_that_is_no_vector_is_told_its_length(discrete: pdmp.Model, goal: object) -> None:
    """The error has the value or its shape, and the number of degrees of freedom."""
    controller = discrete.controller(0.01)
    with pytest.raises(ValueError, match="goal .*, expected one axis: .* of numbers, 2 of them$"):
        controller.goal = goal


def test_ticks_longer_than_the_movement_are_reported(discrete: pdmp.Model) -> None:
    """A rate in place of a tick gives a warning with the tick; shorter ticks give none."""
    with pytest.warns(
        UserWarning, match=r"dt = 1000 s is longer than .* of 1000 Hz pass dt=0\.001"
    ):
        discrete.controller(1000)
    with pytest.warns(UserWarning, match="dt = 100 s is longer than the movement"):
        discrete.controllers(2, dt=100)
    with pytest.warns(UserWarning, match="dt = 10 s is longer .*: the only sample is the start"):
        assert len(discrete.rollout(dt=10).time) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        discrete.controller(discrete.duration)
        discrete.controllers(2, dt=1.5, tau=[2.0, 1.0])
        assert len(discrete.rollout(dt=10, duration=100).time) == 11
        assert len(discrete.rollout(duration=0.0).time) == 1


def test_durations_of_too_many_samples_are_rejected(discrete: pdmp.Model) -> None:
    """A given duration is named beside the interval."""
    with pytest.raises(ValueError, match=r"duration = 1000000000.0: more than .* or enlarge dt$"):
        discrete.rollout(duration=1e9)


@pytest.mark.parametrize("transition", [-1.0, NAN, INF, 1e200])
def test_impossible_transitions_are_rejected(discrete: pdmp.Model, transition: float) -> None:
    """A transition must be finite and not negative."""
    with pytest.raises(ValueError, match="transition = .*: must lie between 0, an immediate"):
        discrete.controller(transition=transition)


def outputs(model: pdmp.Model) -> tuple[np.ndarray, np.ndarray]:
    """Returns output arrays for the rollouts of a model's styles at 0.1 s."""
    shape = model.rollouts(style=model.styles, dt=0.1)[0].shape
    return np.zeros(shape), np.zeros(shape)


def test_outputs_of_another_shape_are_rejected_before_anything_is_written(
    discrete: pdmp.Model,
) -> None:
    """The error states both shapes, and neither array is changed."""
    positions, velocities = outputs(discrete)
    with pytest.raises(ValueError, match=r"out: shape \[5, 12, 2\]; expected .* \[5, 13, 2\]"):
        discrete.rollouts(style=discrete.styles, dt=0.1, out=(positions, velocities[:, :-1]))
    assert not positions.any()


def test_outputs_of_another_type_are_rejected(discrete: pdmp.Model) -> None:
    """Only float64 can be written in place, as the error states."""
    positions, velocities = outputs(discrete)
    with pytest.raises(ValueError, match="out.*float64"):
        discrete.rollouts(
            style=discrete.styles, dt=0.1, out=(positions.astype(np.float32), velocities)
        )


def test_read_only_outputs_are_rejected(discrete: pdmp.Model) -> None:
    """Read-only arrays are not written."""
    positions, velocities = outputs(discrete)
    velocities.setflags(write=False)
    with pytest.raises(ValueError, match="out.* not writeable"):
        discrete.rollouts(style=discrete.styles, dt=0.1, out=(positions, velocities))
    assert not velocities.any()


@pytest.mark.parametrize("u", [[NAN], [INF], [-0.1]])
def test_invalid_clocks_are_rejected(discrete: pdmp.Model, u: list[float]) -> None:
    """A clock must be finite, and not negative for a discrete primitive."""
    with pytest.raises(ValueError, match="u = .*: must be finite, and not negative"):
        discrete.landscape(u)


COMMANDS: list[tuple[str, str, Any]] = [
    *[
        (kind, name, bad)
        for kind, name in (
            ("discrete", "goal"),
            ("discrete", "goal_velocity"),
            ("discrete", "style"),
            ("rhythmic", "anchor"),
            ("rhythmic", "style"),
        )
        for bad in ([NAN, 0], [0], [[0, 0]])
    ],
    *[(kind, "tau", bad) for kind in ("discrete", "rhythmic") for bad in (NAN, 0.0, -1.0, INF)],
    *[("rhythmic", "amplitude", bad) for bad in (NAN, -1.0, INF)],
    *[("rhythmic", "phase", bad) for bad in (NAN, INF, "a", [1.0])],
    *[("discrete", "phase", bad) for bad in (0.5, NAN)],
    *[("rhythmic", "phase_gain", bad) for bad in (NAN, -1.0, 1001.0, None)],
    *[(kind, "tolerance", bad) for kind in ("discrete", "rhythmic") for bad in (NAN, 0, -1, 1.1)],
    *[("discrete", name, [1e200, 0]) for name in ("goal", "goal_velocity")],
    *[("discrete", name, ["a", "b"]) for name in ("goal", "goal_velocity")],
    *[("discrete", "tolerance", bad) for bad in (None, "x", [0.1])],
    ("rhythmic", "goal_velocity", [0, 0]),
]


@pytest.mark.parametrize(("kind", "name", "value"), COMMANDS, ids=str)
def test_invalid_command_leaves_the_loop_unchanged(
    kind: str, name: str, value: Any, request: pytest.FixtureRequest
) -> None:
    """The last valid value stays in force, and the movement continues unchanged."""
    model: pdmp.Model = request.getfixturevalue(kind)
    disturbed, undisturbed = model.controller(0.01), model.controller(0.01)
    for k in range(80):
        if k in (0, 40):
            before = getattr(disturbed, name)
            with pytest.raises(ValueError, match=name):
                setattr(disturbed, name, value)
            np.testing.assert_array_equal(getattr(disturbed, name), before)
        disturbed.step()
        undisturbed.step()
        np.testing.assert_array_equal(disturbed.position, undisturbed.position)
        assert np.isfinite(disturbed.position).all()


@pytest.mark.parametrize("dt", [-0.01, NAN, INF, 1e9])
def test_invalid_tick_leaves_the_state_unchanged(discrete: pdmp.Model, dt: float) -> None:
    """A rejected tick leaves the state unchanged."""
    controller = discrete.controller(0.01)
    controller.step()
    position, time = controller.position.copy(), controller.time
    with pytest.raises(ValueError, match="dt = "):
        controller.step(dt=dt)
    np.testing.assert_array_equal(controller.position, position)
    assert controller.time == time


def test_invalid_reset_leaves_the_movement_unchanged(discrete: pdmp.Model) -> None:
    """A rejected reset does not restart the movement."""
    controller = discrete.controller(0.01)
    controller.step()
    with pytest.raises(ValueError, match=r"goal\[0\] = NaN"):
        controller.reset(goal=[NAN, 0])
    assert controller.time == 0.01
