"""Measured positions and coupling terms from Python."""

import numpy as np
import pytest

import pdmp
from synthetic import reaches


def test_zero_perturbation_changes_nothing(model: pdmp.Model) -> None:
    """A robot without error and terms of zero do not change the movement."""
    plain, perturbed = model.controller(), model.controller()
    for _ in range(100):
        status = plain.step()
        assert perturbed.step(measured=perturbed.position, coupling=([0, 0], [0, 0])) == status
    np.testing.assert_array_equal(plain.position, perturbed.position)
    np.testing.assert_array_equal(plain.acceleration, perturbed.acceleration)


def test_coupling_adds_to_velocity_and_acceleration(reach: pdmp.Model) -> None:
    """Over a short tick, the coupling terms are added to velocity and acceleration."""
    plain, coupled = (reach.controller(dt=1e-7) for _ in range(2))
    plain.step()
    coupled.step(coupling=((0.5, 0), np.float32([0, 3])))
    np.testing.assert_allclose(coupled.velocity - plain.velocity, [0.5, 0], atol=1e-5)
    np.testing.assert_allclose((coupled.acceleration - plain.acceleration)[1], 3, atol=1e-4)


def test_blocked_robot_waits_and_then_arrives(reach: pdmp.Model) -> None:
    """A robot blocked for longer than the movement still reaches its goal and finishes."""
    model = reach
    controller = model.controller()
    for _ in range(500):
        controller.step()
    place = controller.position.copy()
    for _ in range(2000):
        assert controller.step(measured=place) == pdmp.Status.WORKING
    assert abs(controller.position[0] - place[0]) < 0.3
    controller.release()
    while controller.step() == pdmp.Status.WORKING:
        assert controller.time < 6
    np.testing.assert_allclose(controller.position, controller.goal, atol=controller.tolerance)


@pytest.mark.parametrize("transport", ["learnt", "immediate"])
def test_velocity_is_continuous_when_a_robot_is_held_and_released(transport: str) -> None:
    """A changed phase rate does not change the velocity; a release keeps that of the held robot."""
    controller = pdmp.fit(reaches(), n_styles=2, transport=transport).controller(0.001)
    controller.compliance = (1000.0, 0.0)
    for _ in range(500):
        controller.step()
    # An error of a tenth of the range slows the phase elevenfold at once.
    for error in (0.1, 0.0, 0.1):
        before = controller.velocity.copy()
        controller.step(measured=controller.position + [error, 0.0])
        np.testing.assert_allclose(controller.velocity, before, atol=0.1)
    controller.compliance = (1000.0, 10.0)
    place = controller.position.copy()
    for _ in range(500):
        controller.step(measured=place)
    held = controller.velocity.copy()
    controller.release()
    np.testing.assert_allclose(controller.velocity, held, atol=1e-12)
    controller.step()
    np.testing.assert_allclose(controller.velocity, held, atol=0.1)


@pytest.mark.parametrize("speed", [0.0, 0.001, 0.1])
def test_coupling_at_low_speed_does_not_launch_the_movement(speed: float) -> None:
    """An acceleration coupled during a pause leaves no velocity for the full speed."""
    model = pdmp.fit(reaches(), n_styles=2)
    controller, free = model.controller(0.001), model.controller(0.001)
    for _ in range(300):
        controller.step()
        free.step()
    controller.speed = speed
    for _ in range(600):
        controller.step(coupling=([0.0, 0.0], [1.0, 0.0]))
    controller.speed = 1.0
    fastest = 0.0
    for _ in range(3000):
        controller.step()
        free.step()
        fastest = max(fastest, np.abs(controller.velocity).max())
    assert fastest < 3.0
    np.testing.assert_allclose(controller.position, free.position, atol=1e-3)


def test_constant_tracking_error_is_kept_at_the_goal(reach: pdmp.Model) -> None:
    """A constant error prevents neither the goal nor the end of the movement."""
    controller = reach.controller()
    sag = np.array([0.0, 0.02])
    while controller.step(measured=controller.position - sag) == pdmp.Status.WORKING:
        assert controller.time < 6
    np.testing.assert_allclose(controller.position, controller.goal, atol=controller.tolerance)


@pytest.mark.parametrize(
    "bad", [[0.0], [0.0] * 3, [0.0, np.nan], [np.inf, 0.0], [[0.0, 0.0]], ["a", "b"]]
)
def test_invalid_perturbations_are_rejected_and_change_nothing(
    reach: pdmp.Model, bad: list[object]
) -> None:
    """Wrong shapes and numbers that are not finite are named; the state is unchanged."""
    controller = reach.controller()
    controller.step()
    before = controller.position.copy()
    for name, arguments in (
        ("measured", {"measured": bad}),
        ("coupling velocity", {"coupling": (bad, [0, 0])}),
        ("coupling acceleration", {"coupling": ([0, 0], bad)}),
    ):
        with pytest.raises(ValueError, match=name):
            controller.step(**arguments)
    with pytest.raises(TypeError, match="expected two vectors"):
        controller.step(coupling=([0, 0],))
    np.testing.assert_array_equal(controller.position, before)
    assert controller.time == 0.001


def test_compliance_is_checked_and_survives_a_reset(reach: pdmp.Model) -> None:
    """Gains have defaults, are rejected when negative, and survive a reset."""
    controller = reach.controller()
    assert controller.compliance == (1000, 10)
    controller.compliance = (200, 0)
    for bad in ((-1, 0), (0, np.nan), (np.inf, 0)):
        with pytest.raises(ValueError, match=r"stopping|tracking"):
            controller.compliance = bad
    controller.reset()
    assert controller.compliance == (200, 0)
