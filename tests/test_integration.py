"""Movements agree with an integration of the stated equations with a forcing term in closed form.

Demonstrations are polynomials and harmonics, so that their learning targets are known without a
fit: w = e' - z with z' = -alpha_z (beta_z e + z), where e is the distance from the frame and ' the
derivative by the clock. The library contributes its styles, as coordinates, and the transport m(u);
equations, command filters and forcing terms are written down here again and integrated by scipy.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

import pdmp

integrate = pytest.importorskip("scipy.integrate")
interpolate = pytest.importorskip("scipy.interpolate")
optimize = pytest.importorskip("scipy.optimize")

ALPHA, BETA, MU, TRANSITION = 25.0, 6.25, 3.0, 0.3
Function = Callable[[float], np.ndarray]


class Family(NamedTuple):
    """A model and the closed forms of its demonstrations.

    `forcing(u)` (M, D) are the forcing terms of the demonstrations, `frame(u)` is m and m' of a
    discrete movement.
    """

    model: pdmp.Model
    forcing: Function
    frame: Function


def discrete(transport: Any) -> Family:
    """Returns reaches of one second that end at rest, y = y0 + (g - y0) p(s) and k b(s)."""
    reach = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    bend = 64 * np.polynomial.Polynomial([0, 1, -1]) ** 3
    rows = [(0.0, 1.0, 0.2), (0.1, 1.3, -0.3), (-0.2, 0.9, 0.5), (0.05, 1.1, 0.0)]
    paths = [(start + (goal - start) * reach, k * bend) for start, goal, k in rows]
    s = np.linspace(0, 1, 401)
    model = pdmp.fit(
        [np.column_stack([path(s) for path in pair]) for pair in paths],
        dt=s[1], n_styles=2, smoothing=None, transport=transport, alpha_z=ALPHA, beta_z=BETA,
    )  # fmt: skip
    assert model.tau == pytest.approx(1.0)
    profile = interpolate.CubicSpline(s, model.transport(s), bc_type="clamped")
    slope = profile.derivative()

    def frame(u: float) -> np.ndarray:
        if transport == "immediate" or u >= 1:
            return np.array([1.0, 0.0])
        return np.array([profile(u), slope(u)])

    starts, goals = (np.array([[path(end) for path in pair] for pair in paths]) for end in (0, 1))

    def distance(u: float) -> np.ndarray:
        """Returns e and e' (2, M, D)."""
        m, rise = frame(u)
        place = np.array([[path(u) for path in pair] for pair in paths])
        speed = np.array([[path.deriv()(u) for path in pair] for pair in paths])
        return np.array([place - starts - (goals - starts) * m, speed - (goals - starts) * rise])

    def auxiliary(u: float, z: np.ndarray) -> np.ndarray:
        return -ALPHA * (BETA * distance(u)[0].ravel() + z)

    z = integrate.solve_ivp(
        auxiliary, (0, 1), np.zeros(8), "DOP853", rtol=1e-11, atol=1e-12, dense_output=True
    ).sol

    def forcing(u: float) -> np.ndarray:
        inside = min(u, 1.0)
        w = distance(inside)[1] - z(inside).reshape(4, 2)
        if transport == "immediate":
            return w * 0.01 ** (u - inside)  # fades with the phase, which is 0.01 at the end
        return w * np.exp(-ALPHA * (u - inside))  # fades as z does, of a movement at rest

    return Family(model, forcing, frame)


def rhythmic() -> Family:
    """Returns two harmonics about (1, -2) in two seconds; z is their periodic steady state."""
    turns = np.array([1, 2])
    waves = np.array(
        [[[1.0, 0.0], [0.5j, 0.0]], [[1.0, 0.3], [0.5j, -0.2j]], [[1.0, 0.6], [0.5j, -0.4j]]]
    )  # (M, D, K), of the real part
    phi = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    moved = np.real(waves @ np.exp(1j * np.outer(turns, phi)))
    model = pdmp.fit(
        [position.T + [1.0, -2.0] for position in moved],
        dt=2 / 400, kind="rhythmic", n_styles=2, smoothing=None, mu=MU, alpha_z=ALPHA, beta_z=BETA,
    )  # fmt: skip
    assert model.tau == pytest.approx(1 / np.pi)

    def forcing(u: float) -> np.ndarray:
        z = -ALPHA * BETA * waves / (ALPHA + 1j * turns)
        return np.asarray(np.real((1j * turns * waves - z) @ np.exp(1j * turns * u)))

    return Family(model, forcing, lambda _: np.array([1.0, 0.0]))


@pytest.fixture(scope="module")
def families() -> dict[str, Family]:
    """Returns the models, each fitted once."""
    return {
        "learnt": discrete("learnt"),
        "immediate": discrete("immediate"),
        "rhythmic": rhythmic(),
    }


# Of demonstrations, as coordinates of styles: one between two, and one beyond all.
BETWEEN, BEYOND = np.array([0.5, 0.5, 0, 0]), np.array([-0.4, 0, 1.4, 0])
# Of positions of unit size: the regression's error, larger where the forcing ends in a kink.
TOLERANCE = {"learnt": 1e-6, "immediate": 5e-6, "rhythmic": 1e-8}


def integrated(
    family: Family,
    start: dict[str, np.ndarray],
    commands: dict[float, dict[str, np.ndarray]],
    time: np.ndarray,
) -> np.ndarray:
    """Returns positions (T, D) at times; commands pass critically damped filters.

    Shares of the demonstrations, anchor or goal of immediate transport, and amplitude pass theirs
    on the clock, in seconds at the nominal rate; the rate 1/tau passes its own in seconds. With
    learnt transport a goal moves the frame with minimum jerk.
    """
    nominal, discrete = family.model.tau, family.model.kind == "discrete"
    # 99 % of a step are reached after a transition.
    settling = optimize.brentq(lambda s: (1 + s) * np.exp(-s) - 0.01, 1, 20)
    target = {
        "shares": start["shares"],
        "centre": start["centre"],
        "amplitude": np.ones(1),
        "rate": np.array([1 / nominal]),
    }
    omega = settling / TRANSITION
    way_to_goal: Any = None  # of the frame to a later goal, over the clock
    sizes = [len(value) for value in target.values()]
    parts = np.cumsum([1, 1, 2, 2, *sizes, *sizes])[:-1]
    # The frame includes changes of the start.
    way = start["centre"] - start["position"] if discrete else np.zeros(2)

    def moved(u: float, order: int) -> np.ndarray:
        """Returns the displacement of the frame by a later goal, or its derivative."""
        if way_to_goal is None:
            return np.zeros(2)
        return np.asarray(way_to_goal.derivative(order)(np.clip(u, *way_to_goal.x)))

    def flow(t: float, state: np.ndarray) -> np.ndarray:
        u, r, y, z, *filtered = np.split(state, parts)
        value = dict(zip(target, filtered[:4], strict=True))
        speed = dict(zip(target, filtered[4:], strict=True))
        rate = value["rate"][0]
        m, rise = family.frame(u[0])
        w = value["shares"] @ family.forcing(u[0]) * (1 if discrete else r)
        pull = BETA * (y - value["centre"] - way * (m - 1) - moved(u[0], 0)) + z
        slopes = [[rate], rate * MU * (value["amplitude"] - r)]
        slopes += [rate * (z + w + way * rise + moved(u[0], 1)), -rate * ALPHA * pull]
        seconds = {name: 1.0 if name == "rate" else rate * nominal for name in target}
        slopes += [seconds[name] * speed[name] for name in target]
        slopes += [
            seconds[name] * omega * (omega * (target[name] - value[name]) - 2 * speed[name])
            for name in target
        ]
        return np.concatenate(slopes)

    w = start["shares"] @ family.forcing(0.0) + way * family.frame(0.0)[1]
    z = nominal * start["velocity"] - w
    still = [np.zeros(size) for size in sizes]
    state = np.concatenate([[0.0, 1.0], start["position"], z, *target.values(), *still])
    found, last = [], 0.0
    for until in [*sorted(commands), np.inf]:
        inside, end = time[(time >= last) & (time < until)], min(until, time[-1])
        # No long step over the kink that the forcing has at the end of a reach.
        solution = integrate.solve_ivp(
            flow, (last, end), state, "DOP853", rtol=1e-9, atol=1e-11, max_step=0.02,
            t_eval=np.unique([*inside, end]),
        )  # fmt: skip
        found.append(solution.y[2:4, : len(inside)].T)
        state, last = solution.y[:, -1], until
        command = commands.get(until, {})
        if "centre" in command and family.model.braking is not None:
            # The peak velocity is at most that of the attractor after a step, ALPHA / 2e.
            here, change = state[0], command["centre"] - target["centre"]
            there = max(1.0, here + TRANSITION / nominal + 15 / 8 * 2 * np.e / ALPHA)
            ends = [[0 * change] * 3, [change, 0 * change, 0 * change]]
            way_to_goal = interpolate.BPoly.from_derivatives([here, there], ends)
            command = {key: value for key, value in command.items() if key != "centre"}
        target |= command
    return np.concatenate(found)


def started(family: Family, shares: np.ndarray) -> dict[str, np.ndarray]:
    """Returns conditions that differ from those of all demonstrations."""
    return {
        "shares": shares[: family.model.n_demos],
        "position": np.array([0.15, -0.1]),
        "velocity": np.array([0.3, -0.2]),
        "centre": np.array([1.4, 0.25]),
    }


def given(family: Family, start: dict[str, np.ndarray]) -> dict[str, Any]:
    """Returns these conditions as arguments of the library."""
    centre = "goal" if family.model.kind == "discrete" else "anchor"
    return {
        "style": start["shares"] @ family.model.styles,
        "start": start["position"],
        "velocity": start["velocity"],
        centre: start["centre"],
    }


@pytest.mark.parametrize("name", TOLERANCE)
@pytest.mark.parametrize("shares", [BETWEEN, BEYOND], ids=["between", "beyond"])
def test_rollouts_solve_the_equations(
    families: dict[str, Family], name: str, shares: np.ndarray
) -> None:
    """Movements with new style, start, velocity and goal solve the equations, past the end too."""
    family = families[name]
    start = started(family, shares)
    made = family.model.rollout(**given(family, start), dt=0.01, duration=2.0)
    expected = integrated(family, start, {}, made.time)
    np.testing.assert_allclose(made.position, expected, atol=TOLERANCE[name])


COMMANDS: dict[str, dict[float, dict[str, Any]]] = {
    "centre": {0.3: {"centre": [0.9, -0.3]}},
    "style": {0.3: {"shares": BEYOND}},
    "tau": {0.3: {"rate": 2.0}, 0.6: {"rate": 0.5}},
    "amplitude": {0.3: {"amplitude": 1.7}},
    "all": {
        0.2: {"centre": [0.9, -0.3], "rate": 0.6},
        0.4: {"shares": BEYOND},
        0.5: {"amplitude": 0.5, "rate": 1.3},
    },
}  # at times [s]; rates over that of the model
CASES = [
    (name, changed)
    for name in TOLERANCE
    for changed in COMMANDS
    if changed != "amplitude" or name == "rhythmic"
]


def scheduled(family: Family, changed: str) -> dict[float, dict[str, np.ndarray]]:
    """Returns commands at times for a model."""
    model = family.model
    unit = {"rate": 1 / model.tau}
    return {
        at: {
            key: unit.get(key, 1.0) * np.atleast_1d(np.asarray(value, float))[: model.n_demos]
            for key, value in command.items()
            if key != "amplitude" or model.kind == "rhythmic"
        }
        for at, command in COMMANDS[changed].items()
    }


@pytest.mark.parametrize(("name", "changed"), CASES)
def test_commands_in_a_loop_solve_the_equations_of_their_filters(
    families: dict[str, Family], name: str, changed: str
) -> None:
    """Changes of goal or anchor, style, tau and amplitude solve the equations of their filters."""
    family = families[name]
    model, start, commands = family.model, started(family, BETWEEN), scheduled(family, changed)
    controller = model.controller(0.001, **given(family, start), transition=TRANSITION)
    made = [controller.position.copy()]
    for tick in range(1800):
        for key, value in commands.get(tick / 1000, {}).items():
            if key == "shares":
                controller.style = value @ model.styles
            elif key == "rate":
                controller.tau = 1 / value[0]
            elif key == "amplitude":
                controller.amplitude = value[0]
            else:
                setattr(controller, "goal" if model.kind == "discrete" else "anchor", value)
        controller.step()
        made.append(controller.position.copy())
    expected = integrated(family, start, commands, 0.02 * np.arange(91))
    np.testing.assert_allclose(made[::20], expected, atol=TOLERANCE[name])
