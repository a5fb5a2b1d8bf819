"""No value that Python can pass makes the library panic."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import pdmp
from synthetic import loops, reaches

REFUSALS = (ValueError, TypeError, OverflowError, pdmp.FitError)
QUICK = settings(max_examples=300, deadline=None, derandomize=True, database=None)
MODELS = {
    "discrete": pdmp.fit(reaches(), n_styles=2, basis="ngnet"),
    "rhythmic": pdmp.fit(loops(), kind="rhythmic", n_styles=2, basis="ngnet"),
}

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


def some(**strategies: st.SearchStrategy[Any]) -> st.SearchStrategy[dict[str, Any]]:
    """Return dictionaries of any of the arguments."""
    return st.fixed_dictionaries({}, optional=strategies)


FIT = some(
    kind=st.sampled_from(["discrete", "rhythmic", "x", None, 3]),
    n_styles=COUNTS,
    nominal=COUNTS,
    n_samples=COUNTS,
    basis=st.sampled_from(["gp", "ngnet", "x", None, 3, pdmp.GP("matern32", 1e-9), pdmp.NGnet(2)]),
    **dict.fromkeys(
        ["dt", "period", "contexts", "spectrum", "smoothing", "dof_scale", "tau", "alpha_z"], ODD
    ),
    **dict.fromkeys(["beta_z", "alpha_x", "mu"], SCALARS),
)
MOVE = {
    "dt": SPANS,
    "tau": SPANS,
    "amplitude": SCALARS,
    **dict.fromkeys(["goal", "start", "velocity", "anchor"], ODD),
}


def attempt(function: Any, *args: Any, **kwargs: Any) -> Any:
    """Return what a call returns, or None if it was refused in an orderly way."""
    try:
        return function(*args, **kwargs)
    except REFUSALS:
        return None


@pytest.mark.filterwarnings("ignore::numpy.exceptions.ComplexWarning")
@QUICK
@given(st.none() | ODD | st.lists(ODD, min_size=1, max_size=3), FIT)
def test_fit_of_odd_demonstrations_is_orderly(demos: Any, options: dict[str, Any]) -> None:
    """Whatever is passed for demonstrations, a model or an orderly value_error comes out."""
    attempt(pdmp.fit, demos, **options)


@pytest.mark.filterwarnings("ignore::numpy.exceptions.ComplexWarning")
@QUICK
@given(FIT)
def test_fit_with_odd_options_is_orderly(options: dict[str, Any]) -> None:
    """Whatever the options, what is learnt from good demonstrations moves in finite numbers."""
    demos = [demo.position[::10] for demo in reaches()]
    model = attempt(pdmp.fit, demos, **({"dt": 0.2} | options))
    trajectory = model and attempt(model.rollout, dt=model.durations[0] / 20)
    if trajectory is not None:
        assert np.isfinite(trajectory.position).all()


@pytest.mark.filterwarnings("ignore::numpy.exceptions.ComplexWarning")
@pytest.mark.parametrize("kind", MODELS)
@QUICK
@given(some(style=ODD, duration=SPANS, context=ODD, **MOVE))
def test_rollout_with_odd_arguments_is_orderly(kind: str, arguments: dict[str, Any]) -> None:
    """Whatever the arguments, finite positions or an orderly value_error come out."""
    trajectory = attempt(MODELS[kind].rollout, **arguments)
    if trajectory is not None:
        assert np.isfinite(trajectory.position).all()


@pytest.mark.filterwarnings("ignore::numpy.exceptions.ComplexWarning")
@pytest.mark.parametrize("kind", MODELS)
@QUICK
@given(
    ODD | st.just(np.ones((3, 2))),
    some(
        duration=SPANS,
        dt=SPANS,
        tau=SPANS,
        amplitude=SCALARS,
        derivatives=COUNTS,
        threads=COUNTS,
        **dict.fromkeys(["goals", "starts", "velocities", "anchors", "out"], ODD),
    ),
)
def test_batch_with_odd_arguments_is_orderly(
    kind: str, styles: Any, arguments: dict[str, Any]
) -> None:
    """Whatever the arguments, finite numbers or an orderly value_error come out."""
    for values in attempt(MODELS[kind].rollouts, styles, **arguments) or ():
        assert np.isfinite(values).all()


@pytest.mark.filterwarnings("ignore::numpy.exceptions.ComplexWarning")
@pytest.mark.parametrize("kind", MODELS)
@QUICK
@given(
    some(style=ODD, transition=SPANS, **MOVE),
    st.lists(
        st.tuples(st.sampled_from(["goal", "style", "anchor"]), ODD)
        | st.tuples(st.sampled_from(["tau", "amplitude"]), SCALARS),
        max_size=4,
    ),
)
def test_loop_with_odd_commands_is_orderly(
    kind: str, arguments: dict[str, Any], commands: list[tuple[str, Any]]
) -> None:
    """Whatever the commands, every position of the loop is finite."""
    controller = attempt(MODELS[kind].controller, **arguments)
    for name, value in commands if controller is not None else []:
        attempt(setattr, controller, name, value)
        attempt(controller.step)
        assert np.isfinite(controller.position).all()
