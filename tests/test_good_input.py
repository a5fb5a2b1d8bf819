"""Unusual but valid demonstrations are learnt, from any array."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp import Demonstration
from synthetic import DT, loops, reaches

# Few binary digits, so that float32 holds them too; equally long, so that they stack.
POSITIONS = [
    np.round(4096 * np.column_stack([s**3 * (10 - 15 * s + 6 * s**2), k * s * (1 - s)])) / 4096
    for k in (-1.0, 0.5, 2.0)
    for s in [np.linspace(0, 1, 80)]
]
BASES = ["gp", "ngnet"]


def assert_same(model: pdmp.Model, other: pdmp.Model) -> None:
    """Asserts that two models and their movements are equal bit for bit."""
    for name in ("styles", "singular_values", "goals", "starts", "anchors", "durations"):
        np.testing.assert_array_equal(getattr(model, name), getattr(other, name), strict=True)
    made, expected = model.rollout(), other.rollout()
    for name in ("time", "position", "velocity", "acceleration"):
        np.testing.assert_array_equal(getattr(made, name), getattr(expected, name), strict=True)


def assert_close(model: pdmp.Model, other: pdmp.Model) -> None:
    """Asserts that two models and their movements are equal up to rounding."""
    for name in ("styles", "singular_values", "goals", "starts", "anchors", "durations"):
        np.testing.assert_allclose(getattr(model, name), getattr(other, name), atol=1e-11)
    made, expected = model.rollout(), other.rollout()
    np.testing.assert_allclose(made.time, expected.time, atol=1e-14)
    np.testing.assert_allclose(made.position, expected.position, atol=1e-9)


def spaced(x: np.ndarray) -> np.ndarray:
    """Returns every second element of a larger array, along both axes."""
    larger = np.full((2 * x.shape[0], 2 * x.shape[1]), np.nan)
    larger[::2, ::2] = x
    return larger[::2, ::2]


def locked(x: np.ndarray) -> np.ndarray:
    """Returns a read-only copy."""
    x = x.copy()
    x.setflags(write=False)
    return x


def packed(x: np.ndarray) -> np.ndarray:
    """Returns a misaligned field of packed records."""
    records = np.zeros(x.shape, [("value", "f8"), ("other", "f4")])
    records["value"] = x
    field: np.ndarray = records["value"]
    return field


FORMS: dict[str, Callable[[np.ndarray], Any]] = {
    "float32": np.float32,
    "big-endian": lambda x: x.astype(">f8"),
    "Fortran order": np.asfortranarray,
    "strided": spaced,
    "reversed strides": lambda x: np.ascontiguousarray(x[::-1, ::-1])[::-1, ::-1],
    "transposed": lambda x: np.ascontiguousarray(x.T).T,
    "unaligned": lambda x: np.frombuffer(b"." + x.tobytes(), "u1")[1:].view("f8").reshape(x.shape),
    "field of records": packed,
    "read-only": locked,
    "lists": np.ndarray.tolist,
    "tuples": lambda x: tuple(map(tuple, x)),
    "objects": lambda x: x.astype(object),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_form_of_the_array_does_not_matter(form: Callable[[np.ndarray], Any]) -> None:
    """Equal numbers in any form of array give the same model bit for bit."""
    assert_same(
        pdmp.fit([form(x) for x in POSITIONS], dt=DT, n_styles=2),
        pdmp.fit(POSITIONS, dt=DT, n_styles=2),
    )


@pytest.mark.parametrize("dtype", [np.int8, np.int64, np.uint16])
def test_integers_are_numbers(dtype: type) -> None:
    """Integers, such as encoder counts, are learnt as the same float64."""
    counts = [np.round(30 * x + 60) for x in POSITIONS]
    assert_same(pdmp.fit([x.astype(dtype) for x in counts], dt=DT), pdmp.fit(counts, dt=DT))


@pytest.mark.parametrize("order", ["C", "F"])
def test_stack_is_a_list_of_demonstrations(order: Any) -> None:
    """An array (M, T, D) in any memory order is a list of its first axis."""
    stack = np.array(POSITIONS, order=order)
    assert_same(pdmp.fit(stack, dt=DT), pdmp.fit(POSITIONS, dt=DT))


def test_caller_keeps_the_array() -> None:
    """A demonstration copies its array, so that later changes have no effect."""
    position = POSITIONS[0].copy()
    demo = Demonstration(position, dt=DT)
    position[:] = 7
    np.testing.assert_array_equal(demo.position, POSITIONS[0])


@pytest.mark.parametrize("sequence", [tuple, iter])
def test_demonstrations_may_come_in_any_sequence(
    sequence: Callable[[Sequence[np.ndarray]], Any],
) -> None:
    """Any iterable of demonstrations is accepted."""
    assert_same(pdmp.fit(sequence(POSITIONS), dt=DT), pdmp.fit(POSITIONS, dt=DT))


def test_own_interval_takes_precedence() -> None:
    """The interval of a demonstration takes precedence over `dt` of the fit."""
    demos = [Demonstration(x, dt=dt) for x, dt in zip(POSITIONS, (0.01, 0.02, 0.04), strict=True)]
    model = pdmp.fit([demos[0], POSITIONS[1], demos[2]], dt=0.02)
    np.testing.assert_allclose(model.durations, [0.79, 1.58, 3.16])
    assert_same(model, pdmp.fit(demos))


def test_even_time_stamps_are_an_interval() -> None:
    """Time stamps at c dt are equivalent to dt, up to rounding."""
    stamped = [Demonstration(x, time=DT * np.arange(80)) for x in POSITIONS]
    assert_close(pdmp.fit(stamped), pdmp.fit(POSITIONS, dt=DT))


def test_stamps_may_start_anywhere() -> None:
    """Only differences of time stamps matter, which may be negative."""
    time = np.arange(80) / 64
    late = [Demonstration(x, time=time - 1024) for x in POSITIONS]
    assert_same(pdmp.fit(late), pdmp.fit(POSITIONS, dt=1 / 64))


def test_irregular_stamps_give_the_movement_that_was_sampled() -> None:
    """A movement with irregular time stamps is reproduced between its samples."""
    random = np.random.default_rng(1)
    time = np.concatenate([[0.0], np.sort(random.uniform(0.01, 1.99, 118)), [2.0]])
    path = lambda t: np.column_stack([np.sin(t), t * np.cos(t)])  # noqa: E731
    model = pdmp.fit([Demonstration(path(time), time=time)])
    made = model.rollout(dt=0.01)
    np.testing.assert_allclose(made.position, path(made.time), atol=1e-4)


def test_stamped_cycles_with_a_period_are_the_cycles_themselves() -> None:
    """With a period, time stamps of a cycle are equivalent to its interval."""
    demos = loops()
    stamped = [Demonstration(demo.position, time=DT * np.arange(100)) for demo in demos]
    assert_close(
        pdmp.fit(stamped, kind="rhythmic", period=100 * DT), pdmp.fit(demos, kind="rhythmic")
    )


def test_cycles_may_have_a_period_each() -> None:
    """Each cycle may have its own period."""
    demos = [Demonstration(demo.position, time=DT * np.arange(100)) for demo in loops()]
    model = pdmp.fit(demos, kind="rhythmic", period=[2.0, 2.1, 2.2])
    np.testing.assert_array_equal(model.durations, [2.0, 2.1, 2.2])


@pytest.mark.parametrize("basis", BASES)
def test_one_demonstration_is_enough(basis: Any) -> None:
    """One demonstration has one style and is reproduced."""
    model = pdmp.fit(POSITIONS[:1], dt=DT, basis=basis)
    assert (model.n_demos, model.n_styles) == (1, 1)
    np.testing.assert_allclose(model.rollout(dt=DT).position, POSITIONS[0], atol=2e-3)


@pytest.mark.parametrize("n_samples", [45, 50, 51, 60, 100])
def test_network_may_have_as_many_functions_as_there_are_samples(n_samples: int) -> None:
    """With fewer, equal or more samples than the 50 functions, noise is not amplified."""
    s = np.linspace(0, 1, n_samples)[:, None]
    noise = 1e-3 * np.random.default_rng(0).normal(size=s.shape)
    position = s**3 * (10 - 15 * s + 6 * s**2) + noise
    model = pdmp.fit([position], dt=DT, basis="ngnet")
    np.testing.assert_allclose(model.rollout(dt=DT).position, position, atol=0.02)


@pytest.mark.parametrize("kind", ["discrete", "rhythmic"])
@pytest.mark.parametrize("basis", BASES)
def test_models_of_rest_stay_at_rest(kind: Any, basis: Any) -> None:
    """A model of demonstrations at rest stays at rest exactly, beyond their duration too."""
    posture = np.array([0.1 + 0.2, -1e3 / 7, 0.0])
    model = pdmp.fit(np.tile(posture, (3, 20, 1)), dt=DT, kind=kind, basis=basis)
    made = model.rollout(duration=3.0)
    np.testing.assert_array_equal(made.position, np.tile(posture, (len(made.time), 1)))
    assert not made.velocity.any()
    assert not made.acceleration.any()


@pytest.mark.parametrize("basis", BASES)
def test_resting_dofs_rest_beside_moving_ones(basis: Any) -> None:
    """A degree of freedom at rest stays at rest exactly and does not affect the others."""
    moving = pdmp.fit(POSITIONS, dt=DT, n_styles=3, basis=basis).rollout()
    widened = [np.insert(x, 1, 0.1 + 0.2, axis=1) for x in POSITIONS]
    made = pdmp.fit(widened, dt=DT, n_styles=3, basis=basis).rollout()
    assert (made.position[:, 1] == 0.1 + 0.2).all()
    np.testing.assert_allclose(made.position[:, [0, 2]], moving.position, atol=1e-9)


@pytest.mark.parametrize("basis", BASES)
def test_identical_demonstrations_are_one(basis: Any) -> None:
    """Identical demonstrations have one equal style, and move as a single one does."""
    model = pdmp.fit([POSITIONS[0]] * 4, dt=DT, basis=basis)
    assert model.n_styles == 1
    np.testing.assert_allclose(model.styles, model.styles[0, 0], rtol=1e-12)
    single = pdmp.fit([POSITIONS[0]], dt=DT, basis=basis)
    np.testing.assert_allclose(model.rollout().position, single.rollout().position, atol=1e-9)


@pytest.mark.parametrize("scale", [1e-150, 1e-300, 1e149])
@pytest.mark.parametrize("basis", BASES)
def test_magnitude_does_not_matter(scale: float, basis: Any) -> None:
    """Styles and movements do not depend on the unit."""
    model = pdmp.fit(POSITIONS, dt=DT, n_styles=2, basis=basis)
    other = pdmp.fit([scale * x for x in POSITIONS], dt=DT, n_styles=2, basis=basis)
    np.testing.assert_allclose(other.styles, model.styles, atol=1e-9)
    made = other.rollout().position / scale
    np.testing.assert_allclose(made, model.rollout().position, atol=1e-6)


@pytest.mark.parametrize("basis", BASES)
def test_start_may_equal_the_goal(basis: Any) -> None:
    """A movement whose goal equals its start is reproduced; nothing divides by goal - start."""
    s = np.linspace(0, 1, 101)
    there_and_back = 3.0 + 64 * (s * (1 - s))[:, None] ** 3
    model = pdmp.fit([there_and_back], dt=DT, basis=basis)
    np.testing.assert_array_equal(model.starts, model.goals)
    np.testing.assert_allclose(model.rollout(dt=DT).position, there_and_back, atol=1e-3)


def test_start_and_goal_may_be_moved_together() -> None:
    """A common shift of start and goal shifts the path."""
    model = pdmp.fit(reaches(), n_styles=2)
    shift = np.array([2.0, -1.0])
    moved = model.rollout(start=model.starts[2] + shift, goal=model.goals[2] + shift)
    np.testing.assert_allclose(moved.position, model.rollout().position + shift, atol=1e-9)
