"""Bad demonstrations and options are refused with one ValueError that says what to mend."""

import re
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp import Demonstration
from synthetic import loops, reaches

NAN, INF = float("nan"), float("inf")
POSITION = reaches()[2].position
N = len(POSITION)
RATE = {"dt": 0.02}


def changed(value: float) -> np.ndarray:
    """Return positions with one value changed."""
    position = POSITION.copy()
    position[3, 1] = value
    return position


POSITIONS = {
    "NaN": (changed(NAN), r"position\[3, 1\] = NaN: .* finite; fill the gap or cut the row out"),
    "infinity": (changed(-INF), r"position\[3, 1\] = -inf: .* finite; fill the gap or cut"),
    "overflow": (changed(1e200), r"position\[3, 1\] = 1e200: .* overflow .*; .* a larger unit"),
    "None": ([[1.0, None]] * 5, r"position\[0, 1\] = NaN"),
    "three samples": (POSITION[:3], r"position has 3 samples: at least 4 .*; record at a higher"),
    "no DoF": (POSITION[:, :0], r"position has no DoFs: pass .* \(T, D\) with D of at least 1"),
    "one axis": (POSITION[:, 0], rf"position has shape \[{N}\], expected two axes \(T, D\)"),
    "three axes": (POSITION[None], rf"position has shape \[1, {N}, 2\], expected two axes"),
    "scalar": (1.0, r"position has shape \[\], expected two axes"),
    "ragged": ([[1.0, 2.0], [3.0]] * 3, "position is not an array of numbers: .*inhomogeneous"),
    "objects": ([[object()] * 2] * 5, "position is not an array of numbers"),
    "words": ([["left", "right"]] * 5, "position is not an array of numbers"),
    "strings": (POSITION.astype(str), "position is not an array of numbers"),
    "dates": (np.zeros((5, 2), "M8[s]"), "position is not an array of numbers"),
}


@pytest.mark.parametrize(("position", "message"), POSITIONS.values(), ids=POSITIONS)
def test_bad_positions_are_refused(position: Any, message: str) -> None:
    """What is no (T, D) array of at least four rows of finite numbers is refused with the place."""
    with pytest.raises(ValueError, match=message):
        Demonstration(position, **RATE)
    with pytest.raises(ValueError, match=f"demo 1: {message}"):
        pdmp.fit([POSITION, position], **RATE)


@pytest.mark.filterwarnings("ignore::numpy.exceptions.ComplexWarning")
@pytest.mark.parametrize("dtype", [np.complex64, np.complex128])
def test_complex_positions_are_refused(dtype: type) -> None:
    """An imaginary part is never dropped."""
    with pytest.raises(ValueError, match="position is not an array of numbers"):
        Demonstration(POSITION.astype(dtype), **RATE)


GIVEN = {
    "time that repeats": ({"time": [0.0] * N}, r"time\[1\] = 0 s .* after time\[0\] = 0 s: .*drop"),
    "time that falls": ({"time": -np.arange(N)}, r"time\[1\] = -1 s does not come after time\[0\]"),
    "time too short": ({"time": [0, 1, 2]}, f"time has length 3, expected {N}: one .* per sample"),
    "time NaN": ({"time": [0.0] * (N - 1) + [NAN]}, rf"time\[{N - 1}\] = NaN"),
    "time of two axes": ({"time": [[0.0, 1.0]]}, r"time has shape \[1, 2\], expected one axis"),
    "time and dt": ({"time": np.arange(N), "dt": 0.1}, "pass dt or time, not both"),
    "goal too short": ({"goal": [1.0]}, "goal has length 1, expected 2: one value per DoF"),
    "goal NaN": ({"goal": [1.0, NAN]}, r"goal\[1\] = NaN"),
    "context NaN": ({"context": [NAN]}, r"context\[0\] = NaN"),
    "context empty": ({"context": []}, "context is empty: pass at least one number"),
    "names too few": ({"names": ["x"]}, "names has length 1, expected 2: one value per DoF"),
} | {f"dt {dt}": ({"dt": dt}, f"dt = {text}: must be positive and finite") for dt, text in [
    (0.0, "0"), (-0.1, "-0.1"), (NAN, "NaN"), (INF, "inf")
]}  # fmt: skip


@pytest.mark.parametrize(("given", "message"), GIVEN.values(), ids=GIVEN)
def test_bad_descriptions_of_a_demonstration_are_refused(given: Any, message: str) -> None:
    """Time, goal, context and names must fit the positions."""
    with pytest.raises(ValueError, match=message):
        Demonstration(POSITION, **given)


LISTS: dict[str, tuple[Callable[[], Any], str]] = {
    "none": (lambda: [], "demos is empty: pass at least one demonstration"),
    "none stacked": (lambda: np.zeros((0, N, 2)), "demos is empty: pass at least one"),
    "different DoFs": (
        lambda: [POSITION, POSITION[:, :1]],
        "demo 1: position has 1 DoFs, but demo 0 has 2: all must have the same",
    ),
    "one array": (
        lambda: POSITION,
        rf"demos has shape \[{N}, 2\], expected \(M, T, D\): put a single .* into a list",
    ),
    "one demonstration": (lambda: reaches()[0], "demos is a single demonstration: put it into"),
    "one axis": (lambda: POSITION[:, 0], rf"demos has shape \[{N}\], expected \(M, T, D\)"),
    "different names": (
        lambda: [
            Demonstration(POSITION, names=names, **RATE) for names in (["x", "y"], ["y", "x"])
        ],
        "demo 1: names differ",
    ),
    "different contexts": (
        lambda: [Demonstration(POSITION, context=context, **RATE) for context in ([1], [1, 2])],
        "demo 1: context has length 2, expected 1",
    ),
    "context missing": (
        lambda: [Demonstration(POSITION, context=context, **RATE) for context in ([1], None)],
        "demo 1: context has length 0, expected 1",
    ),
}


@pytest.mark.parametrize(("demos", "message"), LISTS.values(), ids=LISTS)
def test_bad_lists_of_demonstrations_are_refused(demos: Callable[[], Any], message: str) -> None:
    """Demonstrations that do not belong together are refused, and the odd one is named."""
    with pytest.raises(ValueError, match=message):
        pdmp.fit(demos(), **RATE)


def numbers(name: str, allowed: str, *values: float) -> list[tuple[dict[str, Any], str]]:
    """Return one case per value of an option, refused with its name, value and range."""
    texts = {0: "0", -1: "-1", INF: "inf"}
    return [({name: v}, f"{name} = {texts.get(v, 'NaN')}: .*{allowed}") for v in values]


OPTIONS: list[tuple[dict[str, Any], str]] = [
    *numbers("dt", "positive and finite", 0, -1, NAN, INF),
    *numbers("spectrum", r"must lie in \(0, 1\]", 0, -1, NAN, INF),
    *numbers("tau", "positive and finite", 0, -1, NAN, INF),
    *numbers("alpha_z", "between 1e-6 and 1e6", 0, -1, NAN, INF),
    *numbers("beta_z", "between 1e-6 and 1e6", 0, -1, NAN, INF),
    *numbers("alpha_x", "between 1e-6 and 1e6", 0, -1, NAN, INF),
    *numbers("smoothing", "positive and finite", 0, -1, NAN, INF),
    *numbers("nominal", "must not be negative", -1),
    *numbers("n_styles", "", 0, -1),
    ({"spectrum": 2}, "spectrum = 2: must lie in"),
    ({"n_styles": 6}, "n_styles = 6: must lie between 1 and 5, the number of demonstrations"),
    ({"nominal": 5}, "nominal = 5: must be the index of a demonstration, from 0"),
    ({"n_samples": 3}, "n_samples = 3: at least 4 samples"),
    ({"n_samples": -1}, "n_samples = -1: must not be negative"),
    ({"smoothing": 25.1}, "smoothing = 25.1: must lie below half the sampling rate"),
    ({"smoothing": "strong"}, "smoothing = 'strong': must be None, \"auto\" or a cut-off in Hz"),
    ({"kind": "circular"}, 'kind = "circular": must be "discrete" or "rhythmic"'),
    ({"basis": "rbf"}, 'basis = \'rbf\': must be "gp", "ngnet"'),
    ({"dof_scale": [1, 0]}, "dof_scale = 0: must be positive and finite"),
    ({"dof_scale": [-1, 1]}, "dof_scale = -1: must be positive"),
    ({"dof_scale": [1]}, "dof_scale has length 1, expected 2: one value per DoF"),
    ({"dof_scale": "unit"}, 'dof_scale = "unit": must be None, "range" or one number per DoF'),
    ({"contexts": [[1], [2], [3], [4], [NAN]]}, r"contexts\[4, 0\] = NaN"),
    ({"contexts": [[1], [2]]}, "contexts has length 2, expected 5: one value per demonstration"),
    ({"contexts": [1, 2, 3, 4, 5]}, r"contexts has shape \[5\], expected two axes \(M, Q\)"),
    ({"period": 2.0}, "period does not apply to a discrete primitive"),
]


@pytest.mark.parametrize(("option", "message"), OPTIONS, ids=str)
def test_bad_options_of_a_fit_are_refused(option: dict[str, Any], message: str) -> None:
    """The option, its value and what is allowed are told."""
    with pytest.raises(ValueError, match=message):
        pdmp.fit([demo.position for demo in reaches()], **(RATE | option))


RHYTHMIC: list[tuple[dict[str, Any], str]] = [
    *numbers("mu", "between 1e-6 and 1e6", 0, -1, NAN, INF),
    *numbers("period", "positive and finite", 0, -1, NAN, INF),
    ({"period": 1.98}, "period = 1.98: must exceed the last time stamp"),
    ({"period": [2, 2]}, "period has length 2, expected 3: one value per demonstration"),
    ({}, "time-stamped cycle .*: pass period= in seconds"),
    ({"period": 2, "tau": 1.0}, "tau does not apply to a rhythmic primitive"),
    ({"period": 2, "alpha_x": 1.0}, "alpha_x does not apply to a rhythmic primitive"),
]


@pytest.mark.parametrize(("option", "message"), RHYTHMIC, ids=str)
def test_bad_options_of_a_rhythmic_fit_are_refused(option: dict[str, Any], message: str) -> None:
    """Periods must exceed the stamps, and constants of the other kind are refused."""
    demos = [Demonstration(demo.position, time=np.arange(100) / 99 * 1.98) for demo in loops()]
    with pytest.raises(ValueError, match=message):
        pdmp.fit(demos, **({"kind": "rhythmic", "period": None} | option))


def test_missing_rate_is_asked_for() -> None:
    """Bare arrays need a sampling interval."""
    with pytest.raises(ValueError, match=r"no sampling interval: pass dt= in seconds"):
        pdmp.fit([POSITION])


@pytest.mark.parametrize(("n_basis", "text"), [(0, "0"), (-5, "-5"), (10**6, "1000000")])
def test_networks_of_impossible_size_are_refused(n_basis: int, text: str) -> None:
    """The number that was given is told."""
    with pytest.raises(ValueError, match=f"n_basis = {text}: must lie between 2 and 1000"):
        pdmp.NGnet(n_basis)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kernel": "cubic"}, 'kernel = "cubic": must be "matern32", "matern52" or'),
        ({"length": 0.0}, "length = 0: must be positive"),
        ({"length": NAN}, "length = NaN: must be positive"),
        ({"noise": 0.0}, "noise = 0: must lie between 1e-10 and 1e6"),
        ({"noise": NAN}, "noise = NaN: must lie between 1e-10 and 1e6"),
    ],
)
def test_impossible_processes_are_refused(arguments: dict[str, Any], message: str) -> None:
    """Kernel, length and noise are checked at once, before any fit."""
    with pytest.raises(ValueError, match=message):
        pdmp.GP(**arguments)


@pytest.mark.parametrize("interval", [1e-300, 1e-160])
def test_rates_whose_squares_overflow_are_refused(interval: float) -> None:
    """A fit is refused where accelerations would not be numbers."""
    with pytest.raises(ValueError, match="dt = 1e-"):
        pdmp.fit([POSITION], dt=interval)


@pytest.mark.parametrize("n_samples", [10**12, 2**60])
def test_more_samples_than_memory_holds_are_refused(n_samples: int) -> None:
    """A slip in n_samples neither panics nor ends the process."""
    code = f"""
import numpy as np, pdmp
try:
    pdmp.fit([np.eye(5)], dt=0.1, n_samples={n_samples}, basis="ngnet")
except (ValueError, MemoryError) as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-300:]
    assert re.search(f"n_samples = {n_samples}", done.stdout)
