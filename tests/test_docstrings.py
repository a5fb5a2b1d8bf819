"""The docstrings of the package have examples that run and describe every parameter."""

import doctest
import importlib
import inspect
import pkgutil
import re
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp import _native
from synthetic import reaches

SHOWN = [
    *("fit", "load", "blend", "Demonstration", "Conditions", "Model.rollout", "Model.predict"),
    *("Model.controller", "Model.save", "Controller.step", "realtime.PacedLoop"),
    *("evaluation.run.evaluate", "evaluation.predictors.Predictor"),
]
"""Names whose docstrings have an example."""


def members() -> Iterator[tuple[str, Any]]:
    """Returns the public names of all modules and of their classes, with their objects."""
    names = [each.name for each in pkgutil.walk_packages(pdmp.__path__, "pdmp.")]
    for module in map(importlib.import_module, sorted(set(names) - {"pdmp.__main__"})):
        for name, found in vars(module).items():
            home = getattr(found, "__module__", None)
            native = module is _native and name in _native.__all__
            if name.startswith("_") or not (native or home == module.__name__):
                continue
            prefix = module.__name__.removesuffix("._native")
            yield f"{prefix}.{name}", found
            if inspect.isclass(found):
                for key in vars(found):
                    if not key.startswith("_"):
                        yield f"{prefix}.{name}.{key}", getattr(found, key)


def native_members() -> list[tuple[str, Any]]:
    """Returns the members of the compiled module."""
    return [(name, found) for name, found in members() if name.split(".")[1] in _native.__all__]


def examples() -> list[doctest.DocTest]:
    """Returns the examples of each docstring that has any, of modules too."""
    parser = doctest.DocTestParser()
    modules = [
        (name, sys.modules[name]) for name in sorted(sys.modules) if name.startswith("pdmp.")
    ]
    found = [
        parser.get_doctest(inspect.getdoc(member) or "", {}, name, None, None)
        for name, member in [*members(), ("pdmp", pdmp), *modules]
    ]
    return [test for test in found if test.examples]


def is_call(member: Any) -> bool:
    """Returns whether a member is a function or a method."""
    return inspect.isroutine(member) and not inspect.isdatadescriptor(member)


@pytest.mark.parametrize("test", examples(), ids=lambda test: test.name)
def test_examples_run(test: doctest.DocTest, reach: pdmp.Model) -> None:
    """Each example prints its stated result for a fitted discrete model."""
    demos = reaches()
    heights = [demo.context for demo in demos]
    test.globs = {"model": reach, "demos": demos, "heights": heights, "np": np, "pdmp": pdmp}
    report: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    runner.run(test, out=report.append)
    assert runner.failures == 0, "".join(report)


def test_the_most_used_names_have_examples() -> None:
    """At least ten docstrings have examples, among them those of the most used names."""
    named = {test.name for test in examples()}
    assert {f"pdmp.{name}" for name in SHOWN} <= named
    assert len(named) >= 10


def test_summaries_have_a_verb_in_the_third_person() -> None:
    """The summary of a function or method is one sentence such as "Returns the style."."""
    calls = [(name, member) for name, member in members() if is_call(member)]
    assert len(calls) > 100
    for name, member in calls:
        summary = (inspect.getdoc(member) or "").partition("\n\n")[0]
        assert re.match(r"[A-Z][a-z]+s ", summary), f"{name}: {summary}"
        assert summary.endswith("."), f"{name}: {summary}"


def test_every_parameter_is_documented() -> None:
    """The section Parameters of a docstring names every parameter of a compiled function."""
    for name, member in native_members():
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
    """Every compiled function with a parameter has a section Raises."""
    for name, member in native_members():
        if is_call(member):
            doc = inspect.getdoc(member) or ""
            has_parameters = "Parameters\n" in doc
            assert not has_parameters or "Raises\n------" in doc, name
