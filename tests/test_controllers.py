"""Controllers of many movements agree with single ones, in memory of numpy."""

import os
import warnings
from typing import Any

import numpy as np
import pytest

import pdmp

NAN = float("nan")
FIELDS = ("position", "velocity", "acceleration")
B = 6


def centre_of(model: pdmp.Model) -> str:
    """Returns the name of the command that moves a movement as a whole."""
    return "goal" if model.kind == "discrete" else "anchor"


def commands(model: pdmp.Model, rng: np.random.Generator) -> dict[str, Any]:
    """Returns random commands of all movements, of which one is shared."""
    drawn: dict[str, Any] = {
        "style": rng.normal(0, 0.5, (B, model.n_styles)),
        centre_of(model): rng.normal(0, 0.5, (B, model.n_dofs)),
        "tau": model.tau * rng.uniform(0.5, 2.0, B),
        "speed": 1.3,
    }
    if model.kind == "rhythmic":
        drawn["amplitude"] = rng.uniform(0.2, 1.5, B)
    return {name: value for name, value in drawn.items() if rng.random() < 0.6}


def test_controllers_are_single_ones_to_the_bit(model: pdmp.Model) -> None:
    """Random commands, masks and restarts move each movement as a controller of its own."""
    rng = np.random.default_rng(0)
    styles = rng.normal(0, 0.3, (B, model.n_styles))
    together = model.controllers(B, dt=0.01, style=styles, tau=1.1 * model.tau)
    alone = [model.controller(dt=0.01, style=style, tau=1.1 * model.tau) for style in styles]
    stepped = 0
    for tick in range(400):
        mask = rng.random(B) < 0.7
        drawn = commands(model, rng) if tick % 37 == 5 else {}
        working = together.step(**drawn, mask=mask)
        for b in np.flatnonzero(mask):
            # Commands of a tick take effect together.
            for name, value in drawn.items():
                setattr(alone[b], name, value if np.ndim(value) == 0 else value[b])
            assert bool(alone[b].step()) == working[b]
            stepped += 1
        if tick % 50 == 49:
            restarted = np.flatnonzero(rng.random(B) < 0.5)
            rows = rng.normal(0, 0.3, (len(restarted), model.n_styles))
            together.reset(restarted, style=rows)
            for b, style in zip(restarted, rows, strict=True):
                alone[b].reset(style=style)
        for name in FIELDS:
            expected = np.array([getattr(controller, name) for controller in alone])
            np.testing.assert_array_equal(getattr(together, name)[mask], expected[mask])
    assert stepped > 1000
    np.testing.assert_array_equal(together.time, [controller.time for controller in alone])
    np.testing.assert_array_equal(together.phase, [controller.phase for controller in alone])


def test_threads_change_nothing(model: pdmp.Model) -> None:
    """Ticks on several threads have the motion of one thread, to the bit, also after a fork."""
    rng = np.random.default_rng(1)
    styles = rng.normal(0, 0.3, (B, model.n_styles))
    one, several = (
        model.controllers(B, dt=0.01, style=styles, threads=threads) for threads in (1, 3)
    )

    def agree(ticks: int) -> bool:
        for _ in range(ticks):
            given = commands(model, rng) if rng.random() < 0.1 else {}
            mask = rng.random(B) < 0.8
            one.step(**given, mask=mask)
            several.step(**given, mask=mask)
        return all(np.array_equal(getattr(one, f), getattr(several, f)) for f in FIELDS)

    assert agree(100)
    if hasattr(os, "fork"):
        with warnings.catch_warnings():
            # Frameworks that other tests have imported warn of the threads that they started.
            warnings.simplefilter("ignore")
            child = os.fork()
        if child == 0:
            agreed = agree(100)
            del several
            os._exit(0 if agreed else 1)
        assert os.waitpid(child, 0)[1] == 0
    assert agree(100)
    with pytest.raises(ValueError, match="threads = 0: must lie between 1 and 1024"):
        model.controllers(B, threads=0)


def test_outputs_are_the_same_arrays(reach: pdmp.Model) -> None:
    """Each tick writes the arrays that were passed, or the same new ones; dlpack shares them."""
    out = tuple(np.zeros((B, 2)) for _ in range(3))
    controllers = reach.controllers(B, dt=0.01, out=out)
    for array, name in zip(out, FIELDS, strict=True):
        assert getattr(controllers, name) is array
    np.testing.assert_array_equal(out[0], np.tile(reach.controller(0.01).position, (B, 1)))
    shared = np.from_dlpack(controllers.position)
    before = shared.copy()
    controllers.step()
    assert np.shares_memory(shared, out[0])
    assert not np.array_equal(shared, before)
    own = reach.controllers(B, dt=0.01)
    position = own.position
    own.step()
    assert own.position is position


def test_a_movement_can_be_taken_out_and_put_back(reach: pdmp.Model) -> None:
    """An item is a copy; assigned, it replaces the movement with all its settings."""
    controllers = reach.controllers(B, dt=0.01)
    for _ in range(20):
        controllers.step()
    one = controllers[2]
    one.tolerance, one.goal = 0.1, [1.3, 0.2]
    assert controllers[2].tolerance != 0.1
    controllers[2] = one
    assert controllers[2].tolerance == 0.1
    controllers.step()
    one.step()
    np.testing.assert_array_equal(controllers.position[2], one.position)
    np.testing.assert_array_equal(controllers[-1].position, controllers.position[B - 1])
    with pytest.raises(IndexError, match="there are 6"):
        controllers[B]
    with pytest.raises(ValueError, match="the tick of the others"):
        controllers[0] = reach.controller(dt=0.02)
    with pytest.raises(TypeError, match="expected pdmp.Controller"):
        controllers[0] = "one"  # type: ignore[call-overload]


def test_limits_hold_for_each(reach: pdmp.Model) -> None:
    """Limits apply to every movement."""
    controllers = reach.controllers(B, dt=0.005, limits=pdmp.Limits(velocity=0.7))
    fastest = 0.0
    while controllers.step(goal=[1.5, 0.5]).any():
        fastest = max(fastest, float(abs(controllers.velocity).max()))
    assert 0.6 < fastest <= 0.7 * (1 + 1e-9)


def test_contexts_predict_each(reach: pdmp.Model) -> None:
    """Rows of conditions and conditions of each are those of single controllers."""
    listed = [reach.conditions(m % reach.n_demos).replace(tau=0.7 + 0.1 * m) for m in range(B)]
    goals = np.random.default_rng(1).normal(size=(B, 2))
    controllers = reach.controllers(B, dt=0.01, conditions=listed, goal=goals)
    alone = [
        reach.controller(0.01, one, goal=goal) for one, goal in zip(listed, goals, strict=True)
    ]
    for _ in range(30):
        controllers.step()
        for controller in alone:
            controller.step()
    expected = np.array([controller.position for controller in alone])
    np.testing.assert_array_equal(controllers.position, expected)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"goal": np.zeros((B - 1, 2))}, r"goal has shape \[5, 2\], expected \(6, 2\)"),
        ({"goal": np.full((B, 2), NAN)}, r"goal\[0\]"),
        ({"anchor": np.zeros((B, 2))}, "anchor does not apply"),
        ({"tau": [1.0, 2.0]}, r"tau has shape \[2\], expected \(6,\)"),
        ({"tau": -1.0}, "tau = -1"),
        ({"speed": -1.0}, "speed = -1"),
        ({"mask": [True]}, "mask: expected 6 truth values"),
    ],
)
def test_rejected_commands_change_nothing(
    reach: pdmp.Model, arguments: dict[str, Any], message: str
) -> None:
    """Wrong commands are named, and no movement moves."""
    controllers = reach.controllers(B, dt=0.01)
    controllers.step()
    before = controllers.position.copy()
    with pytest.raises(ValueError, match=message):
        controllers.step(**arguments)
    np.testing.assert_array_equal(controllers.position, before)
    assert (controllers.time == 0.01).all()


@pytest.mark.parametrize(
    "out",
    [
        (np.zeros((B, 2)), np.zeros((B, 2))),
        (np.zeros((B, 3)), np.zeros((B, 2)), np.zeros((B, 2))),
        (np.zeros((B, 2), np.float32), np.zeros((B, 2)), np.zeros((B, 2))),
        (np.zeros((2, B)).T, np.zeros((B, 2)), np.zeros((B, 2))),
        [np.zeros((B, 2))] * 3,
    ],
)
def test_unsuitable_outputs_are_rejected(reach: pdmp.Model, out: Any) -> None:
    """Outputs of another number, shape, type or order, or that share memory, are refused."""
    with pytest.raises(ValueError, match="out: expected three separate"):
        reach.controllers(B, dt=0.01, out=out)


def test_more_movements_than_fit_into_memory_are_refused(reach: pdmp.Model) -> None:
    """A number that no machine holds is an error that names it, before memory is allocated."""
    for n in (10**12, 2**62):
        with pytest.raises(
            ValueError, match="n_movements = .*: more movements than fit into memory"
        ):
            reach.controllers(n)


def test_errors_of_one_movement_name_it(reach: pdmp.Model) -> None:
    """The row of a bad number is in the error, of conditions, commands and rollouts."""
    goal, tau = np.zeros((B, 2)), np.ones(B)
    goal[3, 1], tau[4] = NAN, -1.0
    controllers = reach.controllers(B, dt=0.01)
    controllers.step()
    for start in (
        lambda **rows: reach.controllers(B, **rows),
        lambda **rows: controllers.step(**rows),
        lambda **rows: controllers.reset(**rows),
    ):
        with pytest.raises(ValueError, match=r"movement 3: goal\[1\] = NaN"):
            start(goal=goal)
        with pytest.raises(ValueError, match="movement 4: tau = -1"):
            start(tau=tau)
    assert (controllers.time == 0.01).all()
    controllers.step(goal=goal, mask=np.arange(B) != 3)
    with pytest.raises(ValueError, match=r"goal\[3, 1\] = NaN"):
        reach.rollouts(goal=goal)
    with pytest.raises(ValueError, match="movement 4: tau = -1"):
        reach.rollouts(tau=tau)


def test_no_movements_are_refused(reach: pdmp.Model) -> None:
    """There is at least one movement, and movements exist."""
    with pytest.raises(ValueError, match="n_movements = 0: start at least one movement"):
        reach.controllers(0)
    controllers = reach.controllers(B)
    with pytest.raises(ValueError, match="there are 6 movements"):
        controllers.reset([B])
    with pytest.raises(ValueError, match="style has 2 rows, but there are 1 movements"):
        controllers.reset([0], style=np.zeros((2, 2)))
