"""Copies of a controller, and forecasts of its movement."""

import copy
import pickle
import threading

import numpy as np
import pytest

import pdmp


def start(model: pdmp.Model, seed: int, ticks: int = 120) -> pdmp.Controller:
    """Returns a controller after random commands."""
    controller = model.controller(0.01)
    for _ in command(controller, model, seed, ticks):
        pass
    return controller


def command(controller: pdmp.Controller, model: pdmp.Model, seed: int, ticks: int):
    """Yields the position of each tick under random commands that depend on the seed alone."""
    random = np.random.default_rng(seed)
    rhythmic = model.kind == "rhythmic"
    for _ in range(ticks):
        kind, vector = random.integers(12), random.normal(size=2)
        if kind == 0:
            controller.style = vector
        elif kind == 1:
            setattr(controller, "anchor" if rhythmic else "goal", vector)
        elif kind == 2:
            controller.tau = model.tau * random.uniform(0.5, 2)
        elif kind == 3:
            controller.speed = random.uniform(0, 1.5)
        elif kind == 4:
            controller.compliance = tuple(random.uniform(0, 100, size=2))
        elif kind == 5 and rhythmic:
            controller.phase = random.uniform(0, 6)
            controller.amplitude = random.uniform(0.5, 2)
        elif kind == 6:
            controller.release()
        controller.step(
            dt=random.choice([0.01, 0.003]),
            measured=random.normal(size=2) if random.integers(10) == 0 else None,
            coupling=(vector, vector) if random.integers(10) == 0 else None,
            phase=random.uniform(0, 6) if rhythmic and random.integers(4) == 0 else None,
        )
        yield controller.position.copy()


def motion(controller: pdmp.Controller) -> np.ndarray:
    """Returns position, velocity and acceleration (3, D)."""
    return np.stack([controller.position, controller.velocity, controller.acceleration])


def pickled(controller: pdmp.Controller) -> pdmp.Controller:
    """Returns the controller after a round trip through pickle."""
    return pickle.loads(pickle.dumps(controller))


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, pickled])
def test_a_copy_is_independent_and_continues_identically(model: pdmp.Model, duplicate) -> None:
    """Under the same commands the copy moves identically, and neither disturbs the other."""
    controller = start(model, seed=1)
    twin = duplicate(controller)
    before = motion(controller)
    assert (twin.time, twin.status, twin.dt) == (controller.time, controller.status, controller.dt)
    np.testing.assert_array_equal(motion(twin), before)
    expected = list(command(twin, model, 2, 100))
    np.testing.assert_array_equal(motion(controller), before)
    np.testing.assert_array_equal(list(command(controller, model, 2, 100)), expected)


def test_a_forecast_equals_the_steps_of_a_copy(model: pdmp.Model) -> None:
    """Also with coarse ticks; the controller stays as it was to the bit."""
    controller = start(model, seed=6)
    controller.release()
    state = controller.__reduce__()[1][1]
    forecast = controller.forecast(1.0, dt=0.1)
    assert controller.__reduce__()[1][1] == state
    twin = copy.copy(controller)
    for k in range(1, 1001):
        twin.step(dt=0.001)
        if k % 100 == 0:
            np.testing.assert_allclose(forecast.position[k // 100], twin.position, atol=1e-7)


def test_a_pickle_of_another_model_or_forged_is_rejected(
    reach: pdmp.Model, cycle: pdmp.Model
) -> None:
    """Every forged number is refused, or leaves a controller that moves by finite numbers."""
    controller = start(reach, seed=5)
    restore, (model, state) = controller.__reduce__()
    with pytest.raises(ValueError, match="another model"):
        restore(cycle, state)
    for damaged in (b"", state[:-1], state[:-8], state + bytes(8)):
        with pytest.raises(ValueError, match="snapshot|state"):
            restore(model, damaged)
    refuse_forged_states(controller, [np.nan, np.inf, -1e300, 1e300])


def refuse_forged_states(controller: pdmp.Controller, values: list[float]) -> None:
    """Asserts that a state with a forged number is refused, mostly, or moves by finite numbers."""
    restore, (model, state) = controller.__reduce__()
    numbers = np.frombuffer(state)
    refused = 0
    for index in range(len(numbers)):
        for value in values:
            forged = numbers.copy()
            forged[index] = value
            try:
                moved = restore(model, forged.tobytes())
                moved.step()
            except ValueError:
                refused += 1
            else:
                assert np.isfinite(motion(moved)).all(), (index, value)
    assert refused > 3 * len(numbers)


def test_a_forecast_is_the_future_of_the_loop(model: pdmp.Model) -> None:
    """Its samples are those of the loop to the bit, and the loop continues undisturbed."""
    controller = start(model, seed=3)
    time = controller.time
    forecast = controller.forecast(0.5)
    assert controller.time == time
    assert forecast.time[0] == 0
    assert forecast.names == model.names
    assert forecast.units == model.units
    for k in range(51):
        if k > 0:
            controller.step()
        found = [forecast.position[k], forecast.velocity[k], forecast.acceleration[k]]
        np.testing.assert_array_equal(found, motion(controller))


def test_a_coarse_forecast_agrees_with_a_fine_one(model: pdmp.Model) -> None:
    """Steps are exact for any length."""
    controller = start(model, seed=4)
    controller.release()
    coarse, fine = controller.forecast(0.8, dt=0.2), controller.forecast(0.8, dt=0.001)
    np.testing.assert_allclose(coarse.position, fine.position[::200], atol=1e-6)


def test_a_loop_continues_during_a_forecast(model: pdmp.Model) -> None:
    """A long forecast in another thread does not lock the controller."""
    controller = model.controller(0.001)
    failures = []

    def forecast() -> None:
        try:
            controller.forecast(300.0)
        except Exception as failure:  # Any failure belongs to the test.
            failures.append(failure)

    thread = threading.Thread(target=forecast)
    thread.start()
    ticks = 0
    while thread.is_alive():
        controller.step()
        ticks += 1
    thread.join()
    assert not failures
    assert ticks > 0


@pytest.mark.parametrize(
    ("horizon", "dt", "message"),
    [
        (-1.0, None, "horizon = -1: must be finite and not negative"),
        (np.nan, None, "horizon = NaN"),
        (np.inf, None, "horizon = inf"),
        ("a", None, "horizon = 'a': expected one number"),
        (1.0, 0.0, "dt = 0: must be positive and finite"),
        (1.0, 1e-12, "horizon = 1: more than 1e7 intervals of dt"),
        (1e9, 1e8, "dt = .*: must not exceed 1000 tau"),
    ],
)
def test_invalid_forecasts_are_rejected(
    model: pdmp.Model, horizon: float, dt: float | None, message: str
) -> None:
    """The error names the argument and its value."""
    controller = model.controller(0.01)
    with pytest.raises(ValueError, match=message):
        controller.forecast(horizon, dt)
