"""The docstrings of the compiled module have examples that run and describe every parameter."""

import doctest
import inspect
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp import _native

SHOWN = [
    *("fit", "load", "blend", "Demonstration", "Conditions", "Model.rollout", "Model.predict"),
    *("Model.controller", "Model.save", "Controller.step"),
]
"""Names whose docstrings have an example."""
IMPERATIVE = re.compile(
    "(Advance|Compute|Condition|Cut|Discard|Estimate|Factorise|Filter|Fit|Inspect|Interpolate|"
    "Predict|Read|Resample|Restart|Return|Start|Trim|Write) "
)
"""First words of the summaries of functions and methods."""


def members() -> Iterator[tuple[str, Any]]:
    """Returns the public names of the module and of its classes, with their objects."""
    for name in _native.__all__:
        found = getattr(_native, name)
        yield name, found
        if inspect.isclass(found):
            for key in vars(found):
                if not key.startswith("_"):
                    yield f"{name}.{key}", getattr(found, key)


def examples() -> list[doctest.DocTest]:
    """Returns the examples of each docstring that has any."""
    parser = doctest.DocTestParser()
    found = [
        parser.get_doctest(inspect.getdoc(member) or "", {}, name, None, None)
        for name, member in members()
        if name != "__version__"
    ]
    return [test for test in found if test.examples]


def is_call(member: Any) -> bool:
    """Returns whether a member is a function or a method."""
    return inspect.isroutine(member) and not inspect.isdatadescriptor(member)


@pytest.mark.parametrize("test", examples(), ids=lambda test: test.name)
def test_examples_run(test: doctest.DocTest, reach: pdmp.Model) -> None:
    """Each example prints its stated result for a fitted discrete model."""
    test.globs = {"model": reach, "np": np, "pdmp": pdmp}
    report: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    runner.run(test, out=report.append)
    assert runner.failures == 0, "".join(report)


def test_the_most_used_names_have_examples() -> None:
    """At least ten docstrings have examples, among them those of the most used names."""
    named = {test.name for test in examples()}
    assert set(SHOWN) <= named
    assert len(named) >= 10


def test_summaries_are_imperative() -> None:
    """The summary of a function or method is one sentence in the imperative mood."""
    for name, member in members():
        if is_call(member):
            summary = (inspect.getdoc(member) or "").partition("\n\n")[0]
            assert IMPERATIVE.match(summary), f"{name}: {summary}"
            assert summary.endswith("."), f"{name}: {summary}"


def test_every_parameter_is_documented() -> None:
    """The section Parameters of a docstring names every parameter of the signature."""
    for name, member in members():
        if not is_call(member) and not inspect.isclass(member):
            continue
        try:
            signature = inspect.signature(member)
        except ValueError:  # a class without constructor
            continue
        doc = inspect.getdoc(member) or ""
        section = re.search(r"Parameters\n-+\n(.*?)(?:\n\n[A-Z]\w+\n-+\n|\Z)", doc, re.DOTALL)
        heads = re.findall(r"^(\S[^:\n]*)(?: :|$)", section[1] if section else "", re.MULTILINE)
        documented = {part.strip().lstrip("*") for head in heads for part in head.split(",")}
        present = set(signature.parameters) - {"self"}
        if inspect.isclass(member):  # of exceptions
            present -= {"args", "kwargs"}
        assert present <= documented, f"{name}: {sorted(present - documented)}"


def test_calls_that_can_fail_list_their_errors() -> None:
    """Every function or method with a parameter has a section Raises."""
    for name, member in members():
        if is_call(member):
            doc = inspect.getdoc(member) or ""
            has_parameters = "Parameters\n" in doc
            assert not has_parameters or "Raises\n------" in doc, name
