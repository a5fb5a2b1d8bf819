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


@pytest.fixture(scope="module", params=["body", "world"])
def poses(request: pytest.FixtureRequest) -> pdmp.Model:
    """Returns a model of poses that move along x and turn about an axis of their own."""
    s = np.linspace(0, 1, 101)
    eased = s**3 * (10 - 15 * s + 6 * s**2)
    demos = []
    for lift, tilt in ((0.1, 0.2), (0.2, -0.1), (0.3, 0.3), (0.15, -0.3)):
        bump = np.sin(np.pi * s) ** 2
        turns = np.column_stack([1.2 * eased, tilt * bump, 0.5 * lift * eased])
        position = np.column_stack([0.4 * eased, 0.1 * eased, lift * bump])
        quaternions = pdmp.preprocessing.rotation_vectors_to_quaternions(turns, order="wxyz")
        coordinates = np.hstack([position, quaternions])
        demos.append(pdmp.Demonstration(coordinates, dt=DT, rotations={3: "wxyz"}))
    return pdmp.fit(demos, n_styles=3, rotation_frame=request.param)


def test_poses_and_angular_velocities_are_passed(poses: pdmp.Model) -> None:
    """A pose with a velocity in the frame of the model is passed; the mean one has no effect."""
    mean = poses.conditions(range(poses.n_demos))
    before = poses.rollout(mean, dt=DT)
    point = pdmp.ViaPoint(0.4, before.position[40], velocity=before.velocity[40])
    same = poses.through(point, tau=mean.tau)
    assert same.distance < 1e-6 and same.n_constraints == 12
    assert np.allclose(poses.rollout(same.conditions, dt=DT).position, before.position, atol=1e-8)

    wanted = 0.95 * before.velocity[40] + [0.0, 0.0, 0.05, 0.0, 0.1, 0.0]
    place = before.position[41]
    passage = poses.through(pdmp.ViaPoint(0.4, place, velocity=wanted), tau=mean.tau)
    found = poses.rollout(passage.conditions, dt=DT)
    assert passage.distance > 0.1
    assert abs(abs(found.position[40, 3:] @ place[3:]) - 1) < 1e-9
    assert np.abs(found.velocity[40] - wanted).max() < 1e-6

    turn = {"position": place[3:], "dofs": [3, 4, 5, 6]}
    passage = poses.through(pdmp.ViaPoint(0.4, velocity=wanted[3:], **turn), tau=mean.tau)
    found = poses.rollout(passage.conditions, dt=DT)
    assert np.abs(found.velocity[40, 3:] - wanted[3:]).max() < 1e-6


def test_angular_velocities_need_an_orientation(poses: pdmp.Model) -> None:
    """Errors say how many numbers a rotation has, and that its velocity needs an orientation."""
    position = poses.rollout(dt=DT).position[40]
    with pytest.raises(ValueError, match="length 7, expected 6.*a rotation has three"):
        poses.through(pdmp.ViaPoint(0.4, position, velocity=np.zeros(7)))
    with pytest.raises(ValueError, match="give the point a position, too"):
        poses.through(pdmp.ViaPoint(0.4, velocity=np.zeros(6)))
    with pytest.raises(ValueError, match="all four"):
        poses.through(pdmp.ViaPoint(0.4, [0.0], dofs=[3]))


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
