"""Movements solve the paper's equations, integrated by scipy; contexts predict movements."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp import Demonstration
from synthetic import DT, loops, reaches

integrate = pytest.importorskip("scipy.integrate")


def solve(
    model: pdmp.Model,
    style: np.ndarray,
    centre: np.ndarray,
    start: np.ndarray,
    z_start: np.ndarray,
    tau: float,
    span: tuple[float, float],
    amplitude: tuple[float, float] = (1.0, 1.0),
) -> tuple[Callable[[np.ndarray], np.ndarray], np.ndarray]:
    """Integrates Eqs. (1) to (4) over a span of time.

    Starts from position and z at its beginning; `amplitude` is r there, and r0. Returns the
    positions as a function of time, and the state (2D,) at the end.
    """
    alpha, beta, n = model.alpha_z, model.beta_z, len(start)
    u_end = model.durations[model.nominal] / model.tau
    # Past the end a movement brakes; z there is that of a movement which began with z = 0.
    braked = model.braking is not None and span[0] > 0
    last = style @ model.landscape([u_end])[0] * np.exp(-(model.alpha_x or 0.0) * u_end)

    def flow(t: float, state: np.ndarray) -> np.ndarray:
        y, z, gate, braking = state[:n], state[n : 2 * n], state[2 * n], state[2 * n + 1]
        discrete = model.kind == "discrete"
        w = gate * (style @ model.landscape([t / tau])[0])  # gate: x, or r
        braking_slope = 0.0
        if braked:
            late = t / tau - u_end
            decay = np.exp(-model.braking / 2 * late)
            # z of the displacement late * decay from the goal, and the forcing that causes it.
            braking_slope = -alpha * (beta * late * decay + braking)
            forcing = (1 - model.braking / 2 * late) * decay - braking
            w = (z_start + last) * forcing - z_start * np.exp(-alpha * late)
        growth = -model.alpha_x * gate if discrete else model.mu * (amplitude[1] - gate)
        slopes = [z + w, alpha * (beta * (centre - y) - z), [growth], [braking_slope]]
        return np.concatenate(slopes) / tau

    gate = np.exp(-model.alpha_x * span[0] / tau) if model.kind == "discrete" else amplitude[0]
    solution = integrate.solve_ivp(
        flow,
        span,
        [*start, *z_start, gate, 0.0],
        "DOP853",
        rtol=1e-10,
        atol=1e-12,
        dense_output=True,
    )
    return lambda t: solution.sol(t)[:n].T, solution.y[: 2 * n, -1]


STYLE, START = np.array([0.5, -0.3]), np.array([0.1, -0.2])


def frame(model: pdmp.Model, goal: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Returns the frame at clocks (n,), less the goal (n, 2), on the movement from START."""
    return np.outer(model.transport(u) - 1, goal - START)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"alpha_z": 10.0, "beta_z": 10.0},
        {"beta_z": 2.0},
        {"beta_z": 2.0, "transport": "immediate"},
    ],
    ids=str,
)
@pytest.mark.parametrize("basis", ["gp", "ngnet"])
def test_reaching_solves_the_equations(options: dict[str, Any], basis: Any) -> None:
    """Critical, under- and overdamped movements agree with an integration from z(0) = 0.

    Seen from the frame c(u) = y0 + (g - y0) m(u) they solve the paper's equations with g = 0.
    """
    model = pdmp.fit(reaches(), n_styles=2, basis=basis, **options)
    goal, tau = np.array([1.2, 0.3]), 0.8 * model.tau
    made = model.rollout(style=STYLE, goal=goal, start=START, tau=tau, dt=0.01, duration=2 * tau)
    moved = made.position - frame(model, goal, made.time / tau)
    end = model.durations[model.nominal] * tau / model.tau
    path, last = solve(model, STYLE, goal, moved[0], np.zeros(2), tau, (0.0, end))
    # Past the end the landscape has a kink, over which no integrator should step.
    later, _ = solve(model, STYLE, goal, last[:2], last[2:], tau, (end, 2 * tau))
    before = made.time <= end
    np.testing.assert_allclose(moved[before], path(made.time[before]), atol=1e-6)
    np.testing.assert_allclose(moved[~before], later(made.time[~before]), atol=1e-6)


@pytest.mark.parametrize("transport", ["learnt", "immediate"])
def test_start_velocity_sets_the_auxiliary_state(transport: Any) -> None:
    """z(0) = tau v - w(0) leads to the same movement as `velocity`."""
    model = pdmp.fit(reaches(), n_styles=2, transport=transport)
    velocity, goal = np.array([0.3, -0.4]), model.goals[2]
    made = model.rollout(style=STYLE, start=START, velocity=velocity, dt=0.01)
    moved = made.position - frame(model, goal, made.time / model.tau)
    z = model.tau * velocity - STYLE @ model.landscape([0.0])[0]
    path, _ = solve(model, STYLE, goal, moved[0], z, model.tau, (0.0, made.time[-1]))
    np.testing.assert_allclose(moved, path(made.time), atol=1e-6)
    np.testing.assert_allclose(made.velocity[0], velocity, atol=1e-12)


@pytest.mark.parametrize("amplitude", [1.0, 1.7])
def test_cycling_solves_the_equations(amplitude: float) -> None:
    """A rhythmic rollout of any amplitude agrees with an integration over two periods."""
    model = pdmp.fit(loops(), kind="rhythmic", n_styles=2)
    anchor, velocity, tau = np.array([0.5, 0.2]), np.array([0.2, 1.0]), 1.3 * model.tau
    made = model.rollout(
        style=STYLE, anchor=anchor, start=START, velocity=velocity, amplitude=amplitude, tau=tau,
        dt=0.01, duration=4 * np.pi * tau,
    )  # fmt: skip
    z = tau * velocity - amplitude * (STYLE @ model.landscape([0.0])[0])
    span = (0.0, made.time[-1])
    path, _ = solve(model, STYLE, anchor, START, z, tau, span, (amplitude, amplitude))
    np.testing.assert_allclose(made.position, path(made.time), atol=1e-6)


def test_changed_amplitude_follows_its_equation() -> None:
    """After a switch of r0 in the loop, r follows tau r' = mu (r0 - r), and y follows r."""
    model = pdmp.fit(loops(), kind="rhythmic", n_styles=2, mu=3.0)
    controller = model.controller(0.001, style=STYLE, anchor=[0.0, 0.0], transition=0)
    controller.step()
    start, velocity = controller.position.copy(), controller.velocity.copy()
    controller.amplitude = 1.7
    w = STYLE @ model.landscape([controller.time / model.tau])[0]
    span = (controller.time, controller.time + 2.0)
    path, _ = solve(
        model, STYLE, np.zeros(2), start, model.tau * velocity - w, model.tau, span, (1.0, 1.7)
    )
    for _ in range(2000):
        controller.step()
        expected = path(np.array([controller.time]))[0]
        np.testing.assert_allclose(controller.position, expected, atol=1e-6)


@pytest.mark.parametrize(("kind", "demos"), [("discrete", reaches), ("rhythmic", loops)])
def test_landscape_has_a_value_per_clock_style_and_dof(kind: Any, demos: Any) -> None:
    """The landscape has shape (n, J, D), for n = 0 too."""
    model = pdmp.fit(demos(), kind=kind, n_styles=2)
    assert model.landscape(np.linspace(0, 1, 7)).shape == (7, 2, 2)
    assert model.landscape([]).shape == (0, 2, 2)


def test_rhythmic_landscape_repeats() -> None:
    """The landscape is periodic."""
    model = pdmp.fit(loops(), kind="rhythmic")
    phi = np.linspace(0, 6, 20)
    turned = model.landscape(phi + 4 * np.pi)
    np.testing.assert_allclose(turned, model.landscape(phi), atol=1e-9)


# A family that is linear in its context: y = base + h shape, all of one duration.
S = np.linspace(0, 1, 101)
BASE = np.column_stack([S**3 * (10 - 15 * S + 6 * S**2), S**2 * (3 - 2 * S)])
SHAPE = np.column_stack([np.sin(2 * np.pi * S) ** 3, S**3 * (10 - 15 * S + 6 * S**2)])


@pytest.fixture(scope="module")
def linear() -> pdmp.Model:
    """Returns a model of five movements of the linear family."""
    demos = [Demonstration(BASE + h * SHAPE, dt=DT, context=[h]) for h in (0, 0.2, 0.5, 0.9, 1.0)]
    return pdmp.fit(demos, n_styles=2, map="linear")


@pytest.mark.parametrize("height", [0.35, 0.7, 1.3])
def test_context_predicts_unseen_movements(linear: pdmp.Model, height: float) -> None:
    """Movements between and beyond the demonstrated contexts are those of the family."""
    prediction = linear.predict([height])
    expected = BASE + height * SHAPE
    np.testing.assert_allclose(prediction.conditions.goal, expected[-1], atol=1e-9)
    np.testing.assert_allclose(prediction.conditions.start, expected[0], atol=1e-9)
    assert prediction.duration == pytest.approx(100 * DT)
    made = linear.rollout(context=[height], dt=DT)
    np.testing.assert_allclose(made.position, expected, atol=1e-4)


def test_rollout_in_context_is_the_rollout_of_its_prediction(linear: pdmp.Model) -> None:
    """A context predicts style, goal, start and tau; keywords take precedence."""
    p = linear.predict([0.4])
    tau = linear.tau * p.duration / linear.durations[linear.nominal]
    made = linear.rollout(context=[0.4], goal=[2.0, 2.0])
    expected = linear.rollout(
        style=p.conditions.style, goal=[2.0, 2.0], start=p.conditions.start, tau=tau
    )
    np.testing.assert_array_equal(made.position, expected.position)


def test_covariance_has_a_row_per_predicted_number(linear: pdmp.Model) -> None:
    """The covariance is of style, goal, start and duration; it vanishes for a linear family."""
    covariance = linear.predict([0.4]).covariance
    assert covariance.shape == (2 + 2 + 2 + 1,) * 2
    np.testing.assert_allclose(covariance, 0, atol=1e-12)
