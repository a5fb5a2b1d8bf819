"""Movements through points, in Python."""

import copy
import pickle

import numpy as np
import pytest

import pdmp

DT = 0.01


@pytest.fixture(scope="module")
def model() -> pdmp.Model:
    """Returns a model of arches of three heights."""
    s = np.linspace(0, 1, 101)
    forward = 0.4 * s**3 * (10 - 15 * s + 6 * s**2)
    upward = [h * np.sin(np.pi * s**k) ** 2 for h in (0.1, 0.2, 0.3) for k in (0.8, 1.0, 1.25)]
    names = ["x", "z"]
    demos = [pdmp.Demonstration(np.column_stack([forward, z]), dt=DT, names=names) for z in upward]
    return pdmp.fit(demos, contexts=[[z.max(), k % 3] for k, z in enumerate(upward)])


def test_points_by_name_index_and_phase_are_passed(model: pdmp.Model) -> None:
    """Degrees of freedom have names or indices, and a phase is that of a controller."""
    for dofs in (["z"], [1], (1,)):
        passage = model.through(pdmp.ViaPoint(0.4, [0.24], dofs=dofs))
        assert abs(model.rollout(passage.conditions, dt=DT).position[40, 1] - 0.24) < 1e-9
    controller = model.controller(dt=DT, conditions=passage.conditions)
    for _ in range(40):
        controller.step()
    assert abs(controller.position[1] - 0.24) < 1e-7
    point = pdmp.ViaPoint(phase=controller.phase, position=[0.13, 0.2])
    passage = model.through([point], tau=model.tau)
    position = model.rollout(passage.conditions, dt=DT).position[40]
    assert np.abs(position - [0.13, 0.2]).max() < 1e-9


def test_batches_carry_the_forcing(model: pdmp.Model) -> None:
    """Rollouts of a batch equal single ones."""
    passed = model.through(pdmp.ViaPoint(0.4, [0.13, 0.3])).conditions
    single = model.rollout(passed, dt=DT).position
    goals = np.stack([passed.goal, passed.goal])
    assert np.allclose(model.rollouts(passed, goal=goals, dt=DT)[0], single, atol=1e-9)


def test_objects_are_copied_and_pickled(model: pdmp.Model) -> None:
    """Points, passages, forcings, conditions and controllers survive copies and pickles."""
    point = pdmp.ViaPoint(0.4, [0.24], velocity=[0.0], dofs=["z"], tolerance=0.1)
    passage = model.through(point)
    for same in (copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))):
        assert same(point) == point
        assert same(passage.forcing) == passage.forcing
        assert same(passage.conditions) == passage.conditions
        assert same(passage).distance == passage.distance
    controller = model.controller(dt=DT, conditions=passage.conditions)
    again = pickle.loads(pickle.dumps(controller))
    for _ in range(50):
        controller.step()
        again.step()
    assert np.array_equal(controller.position, again.position)
    assert again.forcing == passage.forcing
    assert "ViaPoint(time=0.4" in repr(point) and "forcing" in repr(passage.conditions)


def test_given_conditions_and_contexts_hold(model: pdmp.Model) -> None:
    """Conditions that are given remain; a context supplies the others."""
    point = pdmp.ViaPoint(0.4, [0.24], dofs=["z"])
    assert np.array_equal(model.through(point, goal=[0.5, 0.1]).conditions.goal, [0.5, 0.1])
    predicted = model.through(point, context=[0.25, 1]).conditions
    near = model.predict([0.25, 1]).conditions
    assert np.linalg.norm(predicted.style - near.style) < 0.5
    blended = pdmp.blend(predicted.replace(forcing=None), predicted, 0.5)
    value = predicted.forcing.displacement(0.4)[0]
    assert np.allclose(blended.forcing.displacement(0.4)[0], value / 2)


def test_distant_points_are_said(model: pdmp.Model) -> None:
    """Points far from the demonstrations cause a warning."""
    with pytest.warns(UserWarning, match="far from the demonstrations"):
        passage = model.through(pdmp.ViaPoint(0.4, [3.0], dofs=["z"]))
    assert passage.far and passage.distance > 5


@pytest.mark.parametrize(
    ("point", "text"),
    [
        ({"time": 0.4, "phase": 0.5}, "either the time"),
        ({"position": [0.1]}, "either the time"),
        ({"time": 0.4, "position": [0.1], "dofs": ["y"]}, "no 'y'"),
        ({"time": 0.4, "position": [0.1], "dofs": [2]}, "dofs = 2"),
        ({"time": 0.4, "position": [0.1]}, "length 1"),
        ({"time": 0.4, "position": [np.nan, 0]}, "finite"),
        ({"time": 1.4, "position": [0.1, 0.1]}, "time = 1.4"),
        ({"time": 0.4, "position": [0.1, 0.1], "tolerance": -1.0}, "tolerance = -1"),
        ({"time": 0.4}, "constrain nothing"),
        ({"time": 0.0, "velocity": [0.1, 0.1]}, "an end"),
    ],
)
def test_bad_points_are_refused(model: pdmp.Model, point: dict, text: str) -> None:
    """Errors name the argument and the remedy."""
    with pytest.raises(ValueError, match=text):
        model.through(pdmp.ViaPoint(**point), tau=model.tau)


def test_bad_arguments_are_refused(model: pdmp.Model) -> None:
    """Points and forcings must be objects of their classes."""
    with pytest.raises(TypeError, match="ViaPoint"):
        model.through([[0.4, 0.2]])
    with pytest.raises(ValueError, match="at least one"):
        model.through([])
    with pytest.raises(TypeError, match="AdditionalForcing"):
        model.controller(dt=DT).add_forcing(0.1)
    with pytest.raises(ValueError, match="deviation"):
        model.through(pdmp.ViaPoint(0.4, [0.1, 0.1]), deviation=-1)
