"""Arguments of a wrong type are rejected by name, with their value and the expected type."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pdmp
from synthetic import reaches

DEMO = reaches()[0]
SQUARE = np.eye(5)
PREPARATION = pdmp.preprocessing

OBJECTS: list[tuple[Callable[[pdmp.Model], Any], str]] = [
    (lambda m: PREPARATION.unwrap(3), "demo = 3: expected pdmp.Demonstration"),  # type: ignore[call-overload]
    (lambda m: PREPARATION.unwrap(SQUARE), "demo = array.*: expected pdmp.Demonstration"),  # type: ignore[call-overload]
    (lambda m: PREPARATION.lowpass(3, 1), "demo = 3: expected pdmp.Demonstration"),  # type: ignore[call-overload]
    (lambda m: PREPARATION.resample(3, 0.1), "demo = 3: expected pdmp.Demonstration"),  # type: ignore[call-overload]
    (lambda m: PREPARATION.period(3), "demo = 3: expected pdmp.Demonstration"),  # type: ignore[call-overload]
    (lambda m: PREPARATION.split_at(3, [0, 1]), "demo = 3: expected pdmp.Demonstration"),  # type: ignore[call-overload]
    (lambda m: PREPARATION.trim([DEMO, [1]]), r"demo 1: demo = \[1\]: expected pdmp"),  # type: ignore[call-overload]
    (lambda m: m.style_of(3), "demonstration = 3: expected pdmp.Demonstration"),  # type: ignore[arg-type]
    (lambda m: pdmp.blend(1, m.conditions(0), 0.5), "a = 1: expected pdmp.Conditions"),  # type: ignore[arg-type]
    (lambda m: pdmp.blend(m.conditions(0), 2, 0.5), "b = 2: expected pdmp.Conditions"),  # type: ignore[arg-type]
    (lambda m: m.rollout(3), "conditions = 3: expected pdmp.Conditions"),  # type: ignore[arg-type]
    (lambda m: m.controller().step(coupling=3), "coupling = 3: expected two vectors"),  # type: ignore[arg-type]
    (
        lambda m: m.controller().step(coupling=([0, 0],)),  # type: ignore[arg-type]
        r"coupling = \(\[0, 0\],\): expected two vectors",
    ),
    (lambda m: setattr(m.controller(), "compliance", 3), "compliance = 3: expected two gains"),
    (lambda m: pdmp.fit(reaches(), progress=3), "progress = 3: expected a function"),  # type: ignore[arg-type]
    (lambda m: pdmp.evaluate(3), "demos = 3: expected a list of demonstrations"),  # type: ignore[arg-type]
    (lambda m: pdmp.evaluate(reaches(), predictors=3), "predictors = 3: expected a mapping"),  # type: ignore[arg-type]
    (
        lambda m: pdmp.evaluate(reaches(), predictors={"a": 3}),  # type: ignore[dict-item]
        r"predictors\['a'\] = 3: expected an object with a method fit",
    ),
    (lambda m: pdmp.evaluate(reaches(), splits=3), "splits = 3: expected a list"),  # type: ignore[arg-type]
    (lambda m: pdmp.evaluate(reaches(), progress=3), "progress = 3: expected a function"),  # type: ignore[arg-type]
    (lambda m: pdmp.io.read_csv("a.csv", time=3), "time = 3: expected the name of a column"),  # type: ignore[arg-type]
    (lambda m: pdmp.io.write_csv("a.csv", 3), "trajectory = 3: expected pdmp.Trajectory"),  # type: ignore[arg-type]
    (lambda m: pdmp.io.write_csv("a.csv", m.rollout(), names=3), "names = 3: expected a list"),  # type: ignore[arg-type]
    (lambda m: pdmp.io.read(3), "paths = 3: expected a path, or a list of them"),  # type: ignore[arg-type]
    (lambda m: pdmp.PacedLoop(3, rate_hz=1), "controller = 3: expected pdmp.Controller"),  # type: ignore[arg-type]
    (lambda m: pdmp.PacedLoop(m), "controller = <pdmp.Model.*: expected pdmp.Controller"),  # type: ignore[arg-type]
    (lambda m: pdmp.Demonstration(SQUARE, dt=1, names=3), "names = 3: expected a list"),  # type: ignore[arg-type]
]


@pytest.mark.parametrize(("call", "message"), OBJECTS, ids=[text for _, text in OBJECTS])
def test_objects_of_another_type_are_rejected_by_name(
    reach: pdmp.Model, call: Callable[[pdmp.Model], Any], message: str
) -> None:
    """The error is one line with the name of the argument, its value and the expected type."""
    with pytest.raises(TypeError, match=f"^{message}") as error:
        call(reach)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["dt", "max_gap"])
@pytest.mark.parametrize("reader", [pdmp.io.read_csv, pdmp.io.read_npz, pdmp.io.read_bvh])
def test_options_of_readers_that_are_no_numbers_are_rejected_by_name(
    reader: Callable[..., Any], name: str
) -> None:
    """The error names the argument, before the file is read."""
    with pytest.raises(ValueError, match=f"^{name} = 'a': expected one number"):
        reader(Path("none"), **{name: "a"})


@pytest.mark.parametrize("reader", [pdmp.io.read, pdmp.io.read_csv, pdmp.io.read_npz])
def test_invalid_lengths_of_gaps_are_rejected_without_a_gap(reader: Callable[..., Any]) -> None:
    """A length that is negative or no number is named before the file is read."""
    for max_gap in (-1, float("nan")):
        with pytest.raises(ValueError, match=f"^max_gap = {max_gap}: must not be negative"):
            reader(Path("none.csv"), max_gap=max_gap)


@pytest.mark.parametrize(
    "reader",
    [pdmp.load, pdmp.PartialFit.load, pdmp.Prior.load, pdmp.io.read_csv, pdmp.io.read_npz],
)
def test_paths_of_another_type_are_rejected_by_name(reader: Callable[..., Any]) -> None:
    """The error has the name of the argument and its value."""
    for path in (None, 3):
        with pytest.raises(TypeError, match=f"^path = {path}: expected the path of a file"):
            reader(path)


@pytest.mark.parametrize("name", ["n_samples", "max_folds"])
def test_numbers_of_an_evaluation_are_rejected_by_name(name: str) -> None:
    """A text in place of a number is rejected."""
    with pytest.raises(ValueError, match=f"^{name} = 'a': expected one number"):
        pdmp.evaluate(reaches(), **{name: "a"})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("demos", "message"),
    [
        ([], "demos = []: pass the index of at least one demonstration"),
        ([0, 7], "demos = 7: must lie between 0 and 4"),
        (-1, "demos = -1: must lie between 0 and 4"),
        ("a", "demos = 'a': pass the index of a demonstration, or a list of them"),
    ],
)
def test_demonstrations_that_do_not_exist_are_rejected(
    reach: pdmp.Model, demos: Any, message: str
) -> None:
    """The error states the index and the range of indices."""
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        reach.conditions(demos)
