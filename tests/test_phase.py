"""A rhythmic movement synchronises with a measured phase."""

import numpy as np
import pytest

import pdmp


def cycles_between(a: float, b: float) -> float:
    """Returns the distance of two angles in cycles, at most a half."""
    return abs((a - b + np.pi) % (2 * np.pi) - np.pi) / (2 * np.pi)


def test_a_measured_phase_is_followed(cycle: pdmp.Model) -> None:
    """A gait that starts elsewhere and is 10 % faster is followed within 2 % of a cycle."""
    controller = cycle.controller(0.005)
    for _ in range(2000):
        phase = 2.0 + 1.1 * controller.time / cycle.tau
        controller.step(phase=phase)
    assert cycles_between(controller.phase, 2.0 + 1.1 * controller.time / cycle.tau) < 0.02
    free = cycle.controller(0.005)
    for _ in range(2000):
        free.step()
    assert cycles_between(free.phase, 2.0 + 1.1 * free.time / cycle.tau) > 0.1


def test_an_assigned_phase_leaves_position_and_velocity_continuous(cycle: pdmp.Model) -> None:
    """The clock jumps, and the movement then returns to the cycle at the new phase."""
    controller = cycle.controller(0.005)
    for _ in range(100):
        controller.step()
    position, velocity = controller.position.copy(), controller.velocity.copy()
    controller.phase = controller.phase + 2.0
    np.testing.assert_array_equal(controller.position, position)
    np.testing.assert_allclose(controller.velocity, velocity, rtol=0, atol=1e-10)
    expected = cycle.controller(0.005, phase=controller.phase)
    assert np.abs(expected.position - position).max() > 0.1
    for _ in range(1000):
        controller.step()
        expected.step()
    np.testing.assert_allclose(controller.position, expected.position, atol=1e-9)


@pytest.mark.parametrize("stride", [1.5, 2.6])
def test_heel_strikes_adapt_phase_and_period(cycle: pdmp.Model, stride: float) -> None:
    """The rule of Nakanishi et al. 2004 locks onto noisy strides, with a mean within 1 %."""
    heel, gain, random = 0.7, 0.3, np.random.default_rng(0)
    controller = cycle.controller(0.002, transition=0.1)
    periods, errors = [], []
    for _ in range(60):
        start = controller.time
        duration = stride * (1 + 0.01 * random.standard_normal())
        while controller.time - start < duration:
            controller.step()
        errors.append(cycles_between(controller.phase, heel))
        controller.phase = heel
        omega, measured = 1 / controller.tau, 2 * np.pi / (controller.time - start)
        controller.tau = 1 / (omega + gain * (measured - omega))
        periods.append(2 * np.pi * controller.tau)
    assert np.mean(periods[20:]) == pytest.approx(stride, rel=0.01)
    assert np.median(errors[20:]) < 0.02
    assert errors[1] > 0.1


def test_a_discrete_movement_rejects_a_measured_phase(reach: pdmp.Model) -> None:
    """One error names the argument, and the state stays as it was."""
    controller = reach.controller(0.01)
    controller.step()
    position = controller.position.copy()
    with pytest.raises(ValueError, match="phase does not apply to a discrete primitive"):
        controller.step(phase=1.0)
    np.testing.assert_array_equal(controller.position, position)


@pytest.mark.parametrize("phase", [np.nan, np.inf, "a", [1.0]])
def test_an_invalid_measured_phase_is_rejected(cycle: pdmp.Model, phase: object) -> None:
    """A phase is one finite number."""
    controller = cycle.controller(0.01)
    with pytest.raises(ValueError, match="phase = "):
        controller.step(phase=phase)  # type: ignore[arg-type]
    assert controller.time == 0.0
