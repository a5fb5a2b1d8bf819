"""No argument from Python makes the library panic or move in numbers that are not finite.

About half of the calls have valid arguments only, the others one unusual argument. Each test fails
if fewer than half of its calls are accepted, as rejected calls test little.
"""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import pdmp
from synthetic import reaches

REJECTIONS = (ValueError, TypeError, OverflowError, pdmp.FitError)
QUICK = settings(max_examples=300)
FIXTURES = {"discrete": "reach", "rhythmic": "cycle"}
KINDS = pytest.mark.parametrize("kind", FIXTURES)
# Warnings of complex numbers read as real ones, and of unusual demonstrations.
WARNED = pytest.mark.filterwarnings(
    "ignore::numpy.exceptions.ComplexWarning", "ignore::UserWarning"
)

SCALARS = st.sampled_from([0, 1, -1, 0.5, -0.0, 1e-3, 1e9, 1e-300, 1e300, 2**70]) | st.sampled_from(
    [
        float("nan"),
        float("inf"),
        -float("inf"),
        None,
        True,
        "auto",
        "range",
        "x",
        b"x",
        1j,
        object(),
    ]
)
ODD = (
    SCALARS
    | st.lists(SCALARS, max_size=3)
    | st.lists(st.lists(SCALARS, max_size=3), max_size=5)
    | arrays.arrays(
        st.sampled_from([np.float64, np.float32, np.int8, np.uint64, np.bool_]),
        arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5),
    )
)
# A count or an interval that is merely large would be obeyed, at length.
COUNTS = st.sampled_from([-(2**70), -1, 0, 1, 2, 3, 4, 5, 7, 2**70, None, 1.5, "x", float("nan")])
SPANS = st.sampled_from([0, -1, 0.05, 0.3, 1e9, 1e-300, float("nan"), float("inf"), None, "x", 1j])

PLACES = st.lists(st.floats(-2, 2), min_size=2, max_size=2)
SIZES = st.floats(0.1, 3.0)
SHORT = st.sampled_from([0.01, 0.05, 0.3])
Strategy = st.SearchStrategy[Any]


@st.composite
def mostly(draw: st.DrawFn, **strategies: tuple[Strategy | None, Strategy]) -> dict[str, Any]:
    """Draws any of the arguments, each valid; in about half of the draws, one is invalid instead.

    Each argument has a strategy for valid values, None if there are none, and one for unusual ones.
    """
    good = {name: pair[0] for name, pair in strategies.items() if pair[0] is not None}
    drawn: dict[str, Any] = draw(st.fixed_dictionaries({}, optional=good))
    if draw(st.booleans()):
        name = draw(st.sampled_from(sorted(strategies)))
        drawn[name] = draw(strategies[name][1])
    return drawn


class Tally:
    """Counts of accepted and rejected calls."""

    def __init__(self) -> None:
        self.accepted = 0
        self.calls = 0

    def attempt(self, function: Any, *args: Any, **kwargs: Any) -> Any:
        """Returns the result of a call, or None if it was rejected with a reason."""
        self.calls += 1
        try:
            result = function(*args, **kwargs)
        except REJECTIONS as error:
            assert str(error)
            return None
        self.accepted += 1
        return result

    def check(self) -> None:
        """Asserts that at least half of the calls were accepted."""
        share = self.accepted / self.calls
        print(f"{self.accepted} of {self.calls} calls accepted, {share:.0%}")
        assert share >= 0.5


DEMOS = [demo.position[::10] for demo in reaches()]
FIT: dict[str, tuple[Strategy | None, Strategy]] = {
    "n_styles": (st.sampled_from([None, 1, 2]), COUNTS),
    "nominal": (st.integers(0, 4), COUNTS),
    "n_samples": (st.integers(5, 9), COUNTS),
    "basis": (
        st.sampled_from(["gp", "ngnet", pdmp.NGnet(3)]),
        st.sampled_from(["x", None, 3, pdmp.GP("matern32", 1e-9), pdmp.NGnet(2)]),
    ),
    "contexts": (st.just([[0.0], [1.0], [2.0], [3.0], [4.0]]), ODD),
    "smoothing": (st.sampled_from([None, "auto"]), ODD),
    "dof_scale": (st.sampled_from([None, "unit", "range", [1.0, 2.0]]), ODD),
    "tau": (SIZES, ODD),
    "alpha_z": (st.floats(5, 50), ODD),
    "beta_z": (st.floats(2, 10), SCALARS),
    "kind": (None, st.sampled_from(["discrete", "rhythmic", "x", None, 3])),
    "singular_value_share": (None, ODD),
    "period": (None, ODD),
    "alpha_x": (None, SCALARS),
    "mu": (None, SCALARS),
    "dt": (None, ODD),
}


def assert_moves(model: pdmp.Model) -> None:
    """Asserts that a model and its movements are finite."""
    assert np.isfinite(model.styles).all()
    assert np.isfinite(model.durations).all()
    made = model.rollout(dt=model.durations[model.nominal] / 20)
    for values in (made.position, made.velocity, made.acceleration):
        assert np.isfinite(values).all()


@WARNED
def test_fit_of_unusual_demonstrations_is_finite_or_rejected() -> None:
    """Unusual demonstrations give a model with finite movements, or an error with a reason."""
    tally = Tally()

    @QUICK
    @given(SIZES, PLACES, st.sampled_from([None, None, "all", "one", "sample"]), st.data())
    def fits(scale: float, shift: list[float], odd: str | None, data: st.DataObject) -> None:
        demos: Any = [scale * position + shift for position in DEMOS]
        if odd == "all":
            demos = data.draw(ODD)
        elif odd == "one":
            demos[1] = data.draw(ODD)
        elif odd == "sample":
            place = data.draw(st.integers(0, len(demos[1]) - 1))
            demos[1][place, 0] = data.draw(st.floats() | st.floats(-2, 2))
        model = tally.attempt(pdmp.fit, demos, dt=0.2, basis="ngnet")
        if model is not None:
            assert model.n_demos == len(demos)
            assert_moves(model)

    fits()
    tally.check()


@WARNED
def test_fit_with_unusual_options_is_finite_or_rejected() -> None:
    """A fit with unusual options gives a model with finite movements, or an error with a reason."""
    tally = Tally()

    @QUICK
    @given(mostly(**FIT))
    def fits(options: dict[str, Any]) -> None:
        model = tally.attempt(pdmp.fit, DEMOS, **({"dt": 0.2} | options))
        if model is not None:
            assert_moves(model)

    fits()
    tally.check()


def moves(kind: str) -> dict[str, tuple[Strategy | None, Strategy]]:
    """Returns strategies for arguments of one kind; those of the other are invalid."""
    discrete = kind == "discrete"
    return {
        "dt": (SHORT, SPANS),
        "tau": (SIZES, SPANS),
        "start": (PLACES, ODD),
        "velocity": (PLACES, ODD),
        "goal": (PLACES if discrete else None, ODD),
        "goal_velocity": (PLACES if discrete else None, ODD),
        "anchor": (None if discrete else PLACES, ODD),
        "amplitude": (None if discrete else SIZES, SCALARS),
    }


@WARNED
@KINDS
def test_rollout_with_unusual_arguments_is_finite_or_rejected(
    kind: str, request: pytest.FixtureRequest
) -> None:
    """Every accepted rollout is finite."""
    model = request.getfixturevalue(FIXTURES[kind])
    tally = Tally()

    @QUICK
    @given(mostly(style=(PLACES, ODD), duration=(SHORT, SPANS), context=(None, ODD), **moves(kind)))
    def rolls_out(arguments: dict[str, Any]) -> None:
        made = tally.attempt(model.rollout, **arguments)
        if made is not None:
            for values in (made.position, made.velocity, made.acceleration):
                assert np.isfinite(values).all()

    rolls_out()
    tally.check()


@WARNED
@KINDS
def test_batch_with_unusual_arguments_is_finite_or_rejected(
    kind: str, request: pytest.FixtureRequest
) -> None:
    """Every accepted batch is finite."""
    model = request.getfixturevalue(FIXTURES[kind])
    tally = Tally()
    three = arrays.arrays(np.float64, (3, 2), elements=st.floats(-2, 2))

    @QUICK
    @given(
        mostly(
            style=(three, ODD),
            duration=(SHORT, SPANS),
            derivatives=(st.integers(0, 2), COUNTS),
            threads=(st.integers(1, 3), COUNTS),
            out=(None, ODD),
            **moves(kind),
        )
    )
    def rolls_out(arguments: dict[str, Any]) -> None:
        batch = {"style": np.ones((3, 2))} | arguments
        for values in tally.attempt(model.rollouts, **batch) or ():
            assert np.isfinite(values).all()

    rolls_out()
    tally.check()


@WARNED
@KINDS
def test_loop_with_unusual_commands_is_finite(kind: str, request: pytest.FixtureRequest) -> None:
    """Every state of the loop is finite, and a rejected command leaves the state unchanged."""
    model = request.getfixturevalue(FIXTURES[kind])
    tally = Tally()
    centre = "goal" if kind == "discrete" else "anchor"
    vectors = ["style", centre, *(["goal_velocity"] if kind == "discrete" else [])]
    good = (
        st.tuples(st.sampled_from(vectors), PLACES)
        | st.tuples(st.just("tau"), SIZES)
        | st.tuples(st.just("tolerance"), st.floats(1e-9, 1))
    )
    odd = st.tuples(st.sampled_from(["goal", "goal_velocity", "style", "anchor"]), ODD) | st.tuples(
        st.sampled_from(["tau", "amplitude", "tolerance"]), SCALARS
    )

    @QUICK
    @given(
        mostly(style=(PLACES, ODD), transition=(SHORT, SPANS), **moves(kind)),
        st.lists(good | good | odd, max_size=4),
    )
    def steps(arguments: dict[str, Any], commands: list[tuple[str, Any]]) -> None:
        controller = tally.attempt(model.controller, **arguments)
        for name, value in commands if controller is not None else []:
            before, accepted = controller.position.copy(), tally.accepted
            tally.attempt(setattr, controller, name, value)
            if tally.accepted == accepted:
                np.testing.assert_array_equal(controller.position, before)
            tally.attempt(controller.step)
            for values in (controller.position, controller.velocity, controller.acceleration):
                assert np.isfinite(values).all()

    steps()
    tally.check()
