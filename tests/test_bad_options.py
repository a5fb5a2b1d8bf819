"""Invalid options of a fit are rejected with one ValueError that names option, value and range."""

import re
import subprocess
import sys
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp import Demonstration
from synthetic import loops, reaches

NAN, INF = float("nan"), float("inf")
POSITION = reaches()[2].position
RATE = {"dt": 0.02}


def numbers(name: str, allowed: str, *values: float) -> list[tuple[dict[str, Any], str]]:
    """Returns one case per invalid value of an option, with its name, value and range."""
    texts = {0: "0", -1: "-1", INF: "inf"}
    return [({name: v}, f"{name} = {texts.get(v, 'NaN')}: .*{allowed}") for v in values]


OPTIONS: list[tuple[dict[str, Any], str]] = [
    *numbers("dt", "positive and finite", 0, -1, NAN, INF),
    *numbers("singular_value_share", r"must lie in \(0, 1\]", 0, -1, NAN, INF),
    *numbers("tau", "positive and finite", 0, -1, NAN, INF),
    *numbers("alpha_z", "between 1e-6 and 1e6", 0, -1, NAN, INF),
    *numbers("beta_z", "between 1e-6 and 1e6", 0, -1, NAN, INF),
    *numbers("alpha_x", "between 1e-6 and 1e6", 0, -1, NAN, INF),
    *numbers("rotation_length", "between 1e-6 and 1e6", 0, -1, NAN, INF),
    *numbers("smoothing", "positive and finite", 0, -1, NAN, INF),
    *numbers("nominal", "must not be negative", -1),
    *numbers("n_styles", "", 0, -1),
    ({"singular_value_share": 2}, "singular_value_share = 2: must lie in"),
    ({"n_styles": 6}, "n_styles = 6: must lie between 1 and 5, the number of demonstrations"),
    ({"nominal": 5}, "nominal = 5: must be the index of a demonstration, from 0"),
    ({"n_samples": 3}, "n_samples = 3: must lie between 4 and 1e6"),
    ({"n_samples": -1}, "n_samples = -1: must not be negative"),
    ({"smoothing": 25.1}, "smoothing = 25.1 Hz: must lie below half the sampling rate of 50 Hz"),
    ({"smoothing": True}, 'smoothing = True: must be None, "auto" or a cut-off in Hz'),
    ({"mu": 3.0}, "mu does not apply to a discrete"),
    ({"smoothing": "strong"}, "smoothing = 'strong': must be None, \"auto\" or a cut-off in Hz"),
    ({"kind": "circular"}, 'kind = .circular.: must be "discrete" or "rhythmic"'),
    ({"basis": "rbf"}, 'basis = \'rbf\': must be "gp", "ngnet"'),
    ({"dof_scale": [1, 0]}, "dof_scale = 0: must lie between"),
    ({"dof_scale": [-1, 1]}, "dof_scale = -1: must lie between"),
    ({"dof_scale": [1]}, "dof_scale has length 1, expected 2: one value per DoF"),
    ({"dof_scale": "metre"}, 'dof_scale = .metre.: must be None, "unit", "range" or one number'),
    (
        {"n_styles": 2, "singular_value_share": 0.9},
        "n_styles and singular_value_share: pass one of them",
    ),
    ({"contexts": [[1], [2], [3], [4], [NAN]]}, r"demo 4: context\[0\] = NaN"),
    ({"contexts": [[1], [2]]}, "contexts has length 2, expected 5: one value per demonstration"),
    ({"contexts": np.zeros((5, 1, 1))}, r"contexts has shape \[5, 1, 1\], expected axes \(M, Q\)"),
    ({"period": 2.0}, "period does not apply to a discrete primitive"),
]


@pytest.mark.parametrize(("option", "message"), OPTIONS, ids=str)
def test_invalid_options_of_a_fit_are_rejected(option: dict[str, Any], message: str) -> None:
    """The error states the option, its value and the allowed range."""
    with pytest.raises(ValueError, match=message):
        pdmp.fit([demo.position for demo in reaches()], **(RATE | option))


@pytest.mark.parametrize("dt", [0, -5, NAN, INF])
def test_an_invalid_interval_is_rejected_where_none_is_needed(dt: float) -> None:
    """Demonstrations with times of their own do not hide it."""
    with pytest.raises(ValueError, match="dt = .*: must be positive and finite"):
        pdmp.fit(reaches(), dt=dt)
    stamped = pdmp.Demonstration(POSITION, time=np.arange(len(POSITION)) * 0.1)
    with pytest.raises(ValueError, match="dt = .*: must be positive and finite"):
        pdmp.fit([stamped], dt=dt)


RHYTHMIC: list[tuple[dict[str, Any], str]] = [
    *numbers("mu", "between 1e-6 and 1e6", 0, -1, NAN, INF),
    *numbers("period", "positive and finite", 0, -1, NAN, INF),
    ({"period": 1.98}, "period = 1.98: must exceed the last time stamp"),
    ({"period": [2, 2]}, "period has length 2, expected 3: one value per demonstration"),
    ({"period": None}, "period is missing: pass it in seconds"),
    ({"tau": 1.0}, "tau does not apply to a rhythmic primitive"),
    ({"alpha_x": 1.0}, "alpha_x does not apply to a rhythmic primitive"),
]


@pytest.mark.parametrize(("option", "message"), RHYTHMIC, ids=str)
def test_invalid_options_of_a_rhythmic_fit_are_rejected(
    option: dict[str, Any], message: str
) -> None:
    """Periods must exceed the time stamps, and constants of discrete primitives are rejected."""
    demos = [Demonstration(demo.position, time=np.arange(100) / 99 * 1.98) for demo in loops()]
    with pytest.raises(ValueError, match=message):
        pdmp.fit(demos, **({"kind": "rhythmic", "period": 2.0} | option))


def test_missing_interval_is_reported() -> None:
    """Bare arrays need a sampling interval."""
    with pytest.raises(ValueError, match=r"dt is missing: pass the sampling interval in seconds"):
        pdmp.fit([POSITION])


@pytest.mark.parametrize("n_basis", [0, -5, 10**6])
def test_networks_of_impossible_size_are_rejected(n_basis: int) -> None:
    """The error states the number."""
    with pytest.raises(ValueError, match=f"n_basis = {n_basis}: must "):
        pdmp.NGnet(n_basis)


@pytest.mark.parametrize("overlap", [0, -1, 0.29, 3.01, NAN, INF])
def test_networks_of_impossible_width_are_rejected(overlap: float) -> None:
    """The error states the width and its range."""
    with pytest.raises(ValueError, match="overlap = .*: must lie between 0.3 and 3"):
        pdmp.NGnet(overlap=overlap)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kernel": "cubic"}, 'kernel = .cubic.: must be "matern52" or "matern32"'),
        ({"length": 0.0}, "length = 0: must be positive"),
        ({"length": NAN}, "length = NaN: must be positive"),
        ({"noise": 0.0}, "noise = 0: must lie between 1e-10 and 1e6"),
        ({"noise": NAN}, "noise = NaN: must lie between 1e-10 and 1e6"),
    ],
)
def test_impossible_processes_are_rejected(arguments: dict[str, Any], message: str) -> None:
    """Kernel, length and noise are checked at construction, before any fit."""
    with pytest.raises(ValueError, match=message):
        pdmp.GP(**arguments)


@pytest.mark.parametrize("interval", [1e-300, 1e-160])
def test_rates_whose_squares_overflow_are_rejected(interval: float) -> None:
    """A fit is rejected if accelerations would not be finite."""
    with pytest.raises(ValueError, match="duration = .*check dt or time"):
        pdmp.fit([POSITION], dt=interval)


@pytest.mark.parametrize("n_samples", [10**14, 2**60])
def test_more_samples_than_memory_are_rejected(n_samples: int) -> None:
    """A huge n_samples neither panics nor ends the process."""
    code = f"""
import numpy as np, pdmp
try:
    pdmp.fit([np.eye(5)], dt=0.1, n_samples={n_samples}, basis="ngnet")
except (ValueError, MemoryError) as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-300:]
    assert re.search(r"n_samples = [\d.e]+: must lie between 4 and 1e6", done.stdout)


def test_phases_that_underflow_are_rejected() -> None:
    """The final phase, by which the landscape is divided, must not underflow."""
    with pytest.raises(ValueError, match=r"alpha_x = 1000: must not exceed 300"):
        pdmp.fit(reaches(), alpha_x=1000.0)


def test_contexts_that_hardly_vary_are_rejected() -> None:
    """Contexts whose range underflows when squared are rejected."""
    with pytest.raises(ValueError, match=r"contexts = 2\S*e-152: each must vary by"):
        pdmp.fit(reaches(), contexts=[[k * 1e-152] for k in range(5)])


def test_goals_of_cycles_are_rejected() -> None:
    """A goal of a cycle is rejected: cycles have an anchor."""
    loop = Demonstration(loops()[1].position, dt=0.02, goal=[0.0, 0.0])
    with pytest.raises(ValueError, match="demo 1: goal does not apply to a rhythmic"):
        pdmp.fit([loops()[0], loop], kind="rhythmic")


def test_duplicate_names_are_rejected() -> None:
    """Names of degrees of freedom must be unique."""
    with pytest.raises(ValueError, match=r'names\[1\] = "a": repeats a name: the names'):
        Demonstration(POSITION, dt=0.02, names=["a", "a"])


DEMO = Demonstration(POSITION, dt=0.02)
TEXTS: dict[str, tuple[Callable[..., Any], str]] = {
    "kind": (lambda _, **text: pdmp.fit(reaches(), **text), '"discrete" or "rhythmic"'),
    "map": (
        lambda _, **text: pdmp.fit(reaches(), **text),
        '"auto", "stacked", "gp", "polynomial" or "linear"',
    ),
    "transport": (lambda _, **text: pdmp.fit(reaches(), **text), '"learnt" or "immediate"'),
    "alignment": (
        lambda _, **text: pdmp.fit(reaches(), **text),
        '"linear", "warp" or pdmp.TimeWarp(...)',
    ),
    "basis": (
        lambda _, **text: pdmp.fit(reaches(), **text),
        '"gp", "ngnet", pdmp.GP(...) or pdmp.NGnet(...)',
    ),
    "kernel": (lambda _, **text: pdmp.GP(**text), '"matern52" or "matern32"'),
    "wrt": (
        lambda model, **text: model.jacobian(**text),
        '"style", "goal", "anchor", "start", "velocity", "goal_velocity", "amplitude" or "tau"',
    ),
    "periodic": (
        lambda _, **text: pdmp.GP().regress([0.0, 1.0], [[0.0], [1.0]], **text),
        "True or False",
    ),
}


@pytest.mark.parametrize("value", [1, 3.5, b"discrete", [], object, "un\nknown"], ids=str)
@pytest.mark.parametrize("name", TEXTS)
def test_invalid_choices_are_rejected_by_name(model: pdmp.Model, name: str, value: Any) -> None:
    """One line gives the name, the value of any type and the choices."""
    call, choices = TEXTS[name]
    with pytest.raises(ValueError) as raised:
        call(model, **{name: value})
    assert str(raised.value) == f"{name} = {value!r}: must be {choices}"


SCALARS: dict[str, tuple[Callable[..., Any], list[str]]] = {
    "rollout": (
        lambda model, **scalar: model.rollout(**scalar),
        ["dt", "duration", "tau", "amplitude", "phase"],
    ),
    "rollouts": (
        lambda model, **scalar: model.rollouts(style=model.styles, **scalar),
        ["dt", "duration", "tau", "amplitude", "derivatives", "threads"],
    ),
    "rollout_chunks": (
        lambda model, **scalar: model.rollout_chunks(style=model.styles, **scalar),
        ["dt", "duration", "tau", "amplitude", "derivatives", "threads", "size"],
    ),
    "controller": (
        lambda model, **scalar: model.controller(**scalar),
        ["dt", "transition", "tau", "amplitude", "phase"],
    ),
    "step": (lambda model, **scalar: model.controller().step(**scalar), ["dt"]),
    "reset": (lambda model, **scalar: model.controller().reset(**scalar), ["tau", "amplitude"]),
    "command": (
        lambda model, **scalar: setattr(model.controller(), *next(iter(scalar.items()))),
        ["tau", "amplitude", "speed"],
    ),
    "jacobian": (
        lambda model, **scalar: model.jacobian("goal", **scalar),
        ["dt", "duration", "tau", "derivative"],
    ),
    "band": (lambda model, **scalar: model.band([0.0], **scalar), ["level", "dt"]),
    "style_of": (lambda model, **scalar: model.style_of(DEMO, **scalar), ["dt", "period"]),
    "tau_at": (lambda model, phase: model.tau_at(phase, [1.0]), ["phase"]),
    "blend": (
        lambda model, share: pdmp.blend(model.conditions(0), model.conditions(1), share),
        ["share"],
    ),
    "fit": (
        lambda model, **scalar: pdmp.fit([POSITION, POSITION], **(RATE | scalar)),
        [
            *("dt", "n_styles", "singular_value_share", "nominal", "n_samples", "tau"),
            *("alpha_z", "beta_z", "alpha_x", "mu", "threads"),
        ],
    ),
    "Demonstration": (lambda model, dt: Demonstration(POSITION, dt=dt), ["dt"]),
    "Conditions": (
        lambda model, **scalar: pdmp.Conditions(**scalar),
        ["tau", "amplitude", "phase"],
    ),
    "GP": (lambda model, **scalar: pdmp.GP(**scalar), ["length", "noise"]),
    "NGnet": (lambda model, **scalar: pdmp.NGnet(**scalar), ["n_basis", "overlap"]),
    "TimeWarp": (lambda model, **scalar: pdmp.TimeWarp(**scalar), ["n_segments", "max_slope"]),
    "factorise": (
        lambda model, **scalar: pdmp.factorise(np.eye(3), **scalar),
        ["n_styles", "singular_value_share"],
    ),
    "resample": (lambda model, dt: pdmp.preprocessing.resample(DEMO, dt), ["dt"]),
    "trim": (lambda model, threshold: pdmp.preprocessing.trim(DEMO, threshold), ["threshold"]),
    "lowpass": (lambda model, cut_off: pdmp.preprocessing.lowpass(DEMO, cut_off), ["cut_off"]),
}
CALLS = [(call, name) for call, (_, names) in SCALARS.items() for name in names]
NO_SCALARS = {
    "text": "a",
    "list": [1],
    "vector": np.array([1.0, 2.0]),
    "single": np.array([1.0]),
    "complex": 1j,
    "masked": np.ma.masked,
    "interval": np.timedelta64(1, "ns"),
    "object": object(),
}


@pytest.mark.parametrize("value", NO_SCALARS.values(), ids=NO_SCALARS)
@pytest.mark.parametrize(("call", "name"), CALLS)
def test_scalars_that_are_no_numbers_are_rejected_by_name(
    reach: pdmp.Model, call: str, name: str, value: Any
) -> None:
    """The error text begins with the name of the argument and its value, or the number of them."""
    function = SCALARS[call][0]
    text = f"^{name} = .*: (expected one|must be)"
    if call in ("rollouts", "rollout_chunks") and name in ("tau", "amplitude"):
        text += f"|^{name} has [12] rows, but there are 5 movements"
    with pytest.raises(ValueError, match=text):
        function(reach, **{name: value})


@pytest.mark.parametrize("value", [np.float32(0.5), np.array(0.5), Fraction(1, 2), Decimal("0.5")])
def test_every_kind_of_number_is_a_scalar(value: Any) -> None:
    """Objects that convert to a float are accepted."""
    assert pdmp.Conditions(tau=value).tau == pdmp.Conditions(tau=0.5).tau
    assert pdmp.NGnet(overlap=value).overlap == 0.5


@pytest.mark.parametrize("value", [10**400, 2**70])
def test_integers_beyond_the_range_are_rejected_by_name(value: int) -> None:
    """An integer without a float or a machine word is no overflow error without a name."""
    with pytest.raises(ValueError, match=r"^n_basis = 1\d+.*: its magnitude is too large"):
        pdmp.NGnet(value)
    with pytest.raises(ValueError, match=r"^overlap = 1\S*: (its magnitude|must lie)"):
        pdmp.NGnet(overlap=value)
