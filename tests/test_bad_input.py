"""Invalid demonstrations are rejected with one ValueError that states the remedy."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp import Demonstration
from synthetic import reaches

NAN, INF = float("nan"), float("inf")
POSITION = reaches()[2].position
N = len(POSITION)
RATE = {"dt": 0.02}


def changed(value: float) -> np.ndarray:
    """Returns positions with one value changed."""
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
    "masked": (
        np.ma.masked_greater(POSITION, 0.5),
        "position has masked values: fill them, or cut",
    ),
    "words": ([["left", "right"]] * 5, "position has dtype"),
    "numbers as text": ([["1.5", "2"]] * 5, "position has dtype"),
    "text among numbers": ([[1.5, "2"]] * 5, "position has dtype"),
    "text among objects": (
        np.array([[1.5, "2"]] * 5, object),
        "position holds '2': expected real numbers",
    ),
    "arrays of text": ([[1.5, np.array("2")]] * 5, "position has dtype"),
    "bytes": ([[b"1", b"2"]] * 5, "position has dtype"),
    "list of masked": (
        [np.ma.array([1.0, 2.0], mask=[False, True])] * 5,
        "position has masked values: fill them, or cut",
    ),
    "strings": (POSITION.astype(str), "position has dtype"),
    "dates": (np.zeros((5, 2), "M8[s]"), "position has dtype"),
}


@pytest.mark.parametrize(("position", "message"), POSITIONS.values(), ids=POSITIONS)
def test_invalid_positions_are_rejected(position: Any, message: str) -> None:
    """Positions must be (T, D) finite numbers with T ≥ 4; the error locates the fault."""
    with pytest.raises(ValueError, match=message):
        Demonstration(position, **RATE)
    with pytest.raises(ValueError, match=f"demo 1: {message}"):
        pdmp.fit([POSITION, position], **RATE)


@pytest.mark.filterwarnings("ignore::numpy.exceptions.ComplexWarning")
@pytest.mark.parametrize("dtype", [np.complex64, np.complex128])
def test_complex_positions_are_rejected(dtype: type) -> None:
    """Complex numbers are rejected instead of losing their imaginary part."""
    with pytest.raises(ValueError, match="position has dtype"):
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
    "context empty": ({"context": []}, "context is empty: pass at least one value"),
    "names too few": ({"names": ["x"]}, "names has length 1, expected 2: one value per DoF"),
} | {f"dt {dt}": ({"dt": dt}, f"dt = {text}: must be positive and finite") for dt, text in [
    (0.0, "0"), (-0.1, "-0.1"), (NAN, "NaN"), (INF, "inf")
]}  # fmt: skip


@pytest.mark.parametrize(("given", "message"), GIVEN.values(), ids=GIVEN)
def test_invalid_descriptions_of_a_demonstration_are_rejected(given: Any, message: str) -> None:
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
    "lists of them": (
        lambda: {"C": reaches(), "S": reaches()},
        "demo 0 is a list of demonstrations: put all of them into one list",
    ),
    "mappings of them": (
        lambda: [dict(enumerate(reaches())), dict(enumerate(reaches()))],
        r"demo 0 is a mapping of demonstrations, .*demo for part in parts for demo in part",
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
        'demo 1: names\\[0\\] = "y", but demo 0 has "x"',
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
def test_invalid_lists_of_demonstrations_are_rejected(
    demos: Callable[[], Any], message: str
) -> None:
    """Inconsistent demonstrations are rejected, and the deviating one is named."""
    with pytest.raises(ValueError, match=message):
        pdmp.fit(demos(), **RATE)


def test_new_demonstration_has_the_labels_of_the_model() -> None:
    """A style is not inferred from a demonstration with other units or degrees of freedom."""
    described = {"dt": 0.02, "names": ["x", "y"], "units": ["m", "m"]}
    model = pdmp.fit([Demonstration(demo.position, **described) for demo in reaches()])
    for other, message in (
        ({"names": ["x", "z"]}, r'names\[1\] = "z", but the model has "y": put the columns into'),
        ({"units": ["mm", "mm"]}, r'units\[0\] = "mm", but the model has "m": convert'),
    ):
        demo = Demonstration(POSITION, **(described | other))
        with pytest.raises(ValueError, match=message):
            model.style_of(demo)
