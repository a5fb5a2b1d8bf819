"""Data frames, labelled arrays and trajectories are accepted as arrays, with their names."""

import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp import Demonstration
from synthetic import DT, loops, reaches

S = np.linspace(0, 1, 81)
POSITION = np.column_stack([S**3 * (10 - 15 * S + 6 * S**2), S * (1 - S)])
TIME = DT * np.arange(81)


class Frame:
    """Minimal data frame, with a method named like the mask of a masked array."""

    def __init__(self, values: np.ndarray, columns: list[Any] | None = None) -> None:
        self.values, self.shape, self.ndim = values, values.shape, values.ndim
        self.columns = columns

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """Returns the values."""
        return np.array(self.values, dtype=dtype)

    def __iter__(self) -> Any:
        """Iterates over the names of the columns, as data frames do."""
        return iter(self.columns or [])

    def __len__(self) -> int:
        """Returns the number of rows."""
        return len(self.values)

    def mask(self, condition: Any, other: Any = None) -> "Frame":
        """Returns the frame: this is not a masked array."""
        return self

    def any(self) -> bool:
        """Returns True, which would be noticed if this were used as a mask."""
        return True


class Labelled(Frame):
    """Minimal labelled array, whose names are a coordinate."""

    def __init__(self, values: np.ndarray, names: list[str]) -> None:
        super().__init__(values)
        del self.columns
        self.dims = ("time", "joint")
        self.coords = {"joint": Frame(np.array(names))}
        self.attrs = {"units": "rad"}


class Capsule:
    """An array accessible only by DLPack."""

    def __init__(self, values: np.ndarray) -> None:
        self._values = values

    def __dlpack__(self, **options: Any) -> Any:
        """Returns the capsule."""
        return self._values.__dlpack__(**options)

    def __dlpack_device__(self) -> Any:
        """Returns the device of the array."""
        return self._values.__dlpack_device__()


def pandas_frame(values: np.ndarray, columns: list[str]) -> Any:
    """Returns a data frame of pandas."""
    return pytest.importorskip("pandas").DataFrame(values, columns=columns)


def polars_frame(values: np.ndarray, columns: list[str]) -> Any:
    """Returns a data frame of polars."""
    return pytest.importorskip("polars").DataFrame(values, schema=columns, orient="row")


FRAMES = {"stand-in": Frame, "pandas": pandas_frame, "polars": polars_frame}
SERIES: dict[str, Callable[[np.ndarray], Any]] = {
    "stand-in": Frame,
    "capsule": Capsule,
    "pandas": lambda values: pytest.importorskip("pandas").Series(values),
    "polars": lambda values: pytest.importorskip("polars").Series(values),
    "xarray": lambda values: pytest.importorskip("xarray").DataArray(values),
}
frames = pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES)
series = pytest.mark.parametrize("vector", SERIES.values(), ids=SERIES)


@frames
def test_frames_are_positions_with_names(frame: Callable[..., Any]) -> None:
    """Data frames are read bit for bit, with names and units of their columns."""
    demo = Demonstration(frame(POSITION, ["x", "knee [rad]"]), dt=DT)
    np.testing.assert_array_equal(demo.position, POSITION)
    assert (demo.names, demo.units) == (["x", "knee"], ["", "rad"])
    named = Demonstration(frame(POSITION, ["x", "y"]), dt=DT, names=["a", "b"], units=["m", "m"])
    assert (named.names, named.units) == (["a", "b"], ["m", "m"])


def test_columns_without_names_give_none() -> None:
    """Columns that are numbers give no names."""
    assert Demonstration(Frame(POSITION, [0, 1]), dt=DT).names is None
    assert Demonstration(Frame(POSITION), dt=DT).names is None


def test_labelled_arrays_have_names_and_units() -> None:
    """The coordinate along the last axis names the degrees of freedom."""
    demo = Demonstration(Labelled(POSITION, ["hip", "knee"]), dt=DT)
    assert (demo.names, demo.units) == (["hip", "knee"], ["rad", "rad"])
    xarray = pytest.importorskip("xarray")
    array = xarray.DataArray(
        POSITION,
        dims=("time", "joint"),
        coords={"joint": ["hip", "knee"], "time": TIME},
        attrs={"units": "rad"},
    )
    demo = Demonstration(array, time=array.time)
    np.testing.assert_array_equal(demo.time, TIME)
    assert (demo.names, demo.units) == (["hip", "knee"], ["rad", "rad"])


@series
def test_vectors_are_accepted_as_arrays(vector: Callable[[np.ndarray], Any]) -> None:
    """Time, goals, styles and commands are accepted from any array object."""
    given = {"time": TIME, "goal": np.array([2.0, 1.0])}
    plain = Demonstration(POSITION, **given)
    demo = Demonstration(POSITION, **{name: vector(values) for name, values in given.items()})
    np.testing.assert_array_equal(demo.time, plain.time)
    np.testing.assert_array_equal(demo.goal, plain.goal)
    model = pdmp.fit(reaches(), n_styles=2)
    style, goal = np.array([0.1, -0.2]), np.array([1.0, 0.5])
    made = model.rollout(style=vector(style), goal=vector(goal), context=None)
    np.testing.assert_array_equal(made.position, model.rollout(style=style, goal=goal).position)
    controller = model.controller(0.01)
    controller.goal, controller.style = vector(goal), vector(style)
    np.testing.assert_array_equal(controller.goal, goal)
    np.testing.assert_array_equal(model.landscape(vector(S)), model.landscape(S))
    context = np.array([0.3])
    assert model.predict(vector(context)).conditions == model.predict([0.3]).conditions


@frames
def test_frames_are_demonstrations_and_contexts(frame: Callable[..., Any]) -> None:
    """Data frames are demonstrations, in lists and mappings; their rows are contexts."""
    scales = np.array([[1.0], [2.0], [3.0], [4.0]])
    movements = [frame(scale * POSITION, ["x", "y"]) for scale in scales]
    expected = pdmp.fit([scale * POSITION for scale in scales], dt=DT, contexts=scales)
    contexts = frame(scales, ["height"])
    for given in (movements, dict(zip("abcd", movements, strict=True))):
        model = pdmp.fit(given, dt=DT, contexts=contexts)
        np.testing.assert_array_equal(model.styles, expected.styles)
        np.testing.assert_array_equal(model.contexts, scales)
        assert model.names == ["x", "y"]
        found = pdmp.evaluate(given, dt=DT, contexts=contexts, predictors={})
        np.testing.assert_array_equal(found.recordings.contexts, scales)
        assert found.recordings.names == ["x", "y"]
    batch = model.rollouts(style=frame(model.styles, [f"s{j}" for j in range(model.n_styles)]))
    np.testing.assert_array_equal(batch[0], model.rollouts(style=model.styles)[0])


def test_frames_of_numbers_and_labels_are_contexts() -> None:
    """A data frame of mixed columns gives numbers and labels."""
    values = np.array([[1.0, "left"], [2.0, "right"], [3.0, "left"]], object)
    model = pdmp.fit([k * POSITION for k in (1, 2, 3)], dt=DT, contexts=Frame(values, ["h", "s"]))
    assert model.contexts == [[1.0, "left"], [2.0, "right"], [3.0, "left"]]


def test_dates_are_times_from_the_first() -> None:
    """Dates and durations of numpy are converted to seconds from any unit."""
    since = np.datetime64("2026-03-01T12:00", "ns") + np.round(1e9 * TIME).astype("m8[ns]")
    for time in (since, since - since[0], since.astype("M8[us]")):
        np.testing.assert_allclose(Demonstration(POSITION, time=time).time, TIME, atol=1e-12)
    with pytest.raises(ValueError, match=r"time\[3\] = NaN"):
        Demonstration(POSITION, time=np.where(np.arange(81) == 3, np.datetime64("NaT"), since))


TEXTS: dict[str, Any] = {
    "one": "12",
    "bytes": b"12",
    "bytes that are writable": bytearray(b"12"),
    "writable bytes in a tuple": ([bytearray(b"1")], [bytearray(b"2")]),
    "list": ["1", "2"],
    "list with numbers": [1.0, "2"],
    "tuple": (1, "2"),
    "array": np.array(["1", "2"]),
    "objects": np.array([1.0, "2"], object),
    "objects of bytes": np.array([1.0, b"2"], object),
    "scalars of numpy": np.array([1.0, np.str_("2")], object),
    "array in a list": [1.0, np.array("2")],
    "frame": Frame(np.array(["1", "2"], object)),
    "dates": np.array(["2020", "2021"], "M8[Y]"),
    "complex numbers": [1j, 2],
}


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_text_is_never_read_as_numbers(text: Any) -> None:
    """Text is rejected at any depth, and the argument is named."""
    model = pdmp.fit(reaches(), n_styles=2)
    controller = model.controller(0.01)
    for call, name in (
        (lambda: Demonstration(POSITION, dt=DT, goal=text), "goal"),
        (lambda: model.rollout(goal=text), "goal"),
        (lambda: model.rollout(style=text), "style"),
        (lambda: model.rollouts(style=[text]), "style"),
        (lambda: setattr(controller, "goal", text), "goal"),
        (lambda: pdmp.fit(reaches(), dof_scale=text), "dof_scale"),
    ):
        with pytest.raises(ValueError, match=rf"^{name}\b"):
            call()
    np.testing.assert_array_equal(controller.goal, model.controller(0.01).goal)


@pytest.mark.parametrize("value", [b"1.5", np.bytes_(b"1.5"), np.array("1.5"), np.complex128(1)])
def test_context_is_numbers_and_texts(value: Any) -> None:
    """Bytes and texts in arrays are rejected, not parsed as numbers."""
    model = pdmp.fit(reaches())
    with pytest.raises(ValueError, match=r"context\[0\] holds"):
        model.predict([value])


def test_missing_values_of_pandas_are_named() -> None:
    """NA of pandas is reported clearly."""
    pandas = pytest.importorskip("pandas")
    column = pandas.array([1, None] * 5, dtype="Int64")
    with pytest.raises(ValueError, match="position has missing values: fill them, or cut"):
        Demonstration(pandas.DataFrame({"x": column, "y": np.arange(10.0)}), dt=DT)


@pytest.fixture
def trajectory() -> pdmp.Trajectory:
    """Returns a movement of two degrees of freedom with units."""
    return pdmp.fit(reaches()).rollout(dt=0.013)


def test_trajectories_have_names_and_units(trajectory: pdmp.Trajectory) -> None:
    """Trajectories have the names and units of the model, also after pickling."""
    for made in (trajectory, pickle.loads(pickle.dumps(trajectory))):
        assert (made.names, made.units) == (["x", "y"], ["m", "m"])


def assert_back(demo: Demonstration, trajectory: pdmp.Trajectory) -> None:
    """Asserts that a demonstration equals a trajectory bit for bit, with its names and units."""
    np.testing.assert_array_equal(demo.position, trajectory.position)
    np.testing.assert_array_equal(demo.time, trajectory.time)
    assert (demo.names, demo.units) == (trajectory.names, trajectory.units)


def test_trajectories_are_demonstrations(trajectory: pdmp.Trajectory) -> None:
    """Trajectories are demonstrations in a constructor, a fit and an evaluation."""
    assert_back(Demonstration(trajectory), trajectory)
    assert Demonstration(trajectory, dt=0.5).dt == 0.5
    demo = Demonstration(trajectory)
    model = pdmp.fit([trajectory] * 2)
    np.testing.assert_array_equal(model.styles, pdmp.fit([demo] * 2).styles)
    assert (model.names, model.units) == (trajectory.names, trajectory.units)
    found = pdmp.evaluate([trajectory] * 3, contexts=[[1], [2], [3]], predictors={})
    assert_back(found.recordings.demos[0], trajectory)
    with pytest.raises(ValueError, match="single demonstration: put it into a list"):
        pdmp.fit(trajectory)


def test_trajectories_come_back_from_files(trajectory: pdmp.Trajectory, tmp_path: Path) -> None:
    """CSV and NPZ files preserve every bit, names and units."""
    trajectory.to_csv(tmp_path / "a.csv")
    assert_back(pdmp.io.read_csv(tmp_path / "a.csv"), trajectory)
    assert_back(pdmp.io.read_csv(tmp_path / "a.csv", columns=trajectory.names), trajectory)
    np.savez(tmp_path / "a.npz", **trajectory.to_dict())
    (demo,) = pdmp.io.read_npz(tmp_path / "a.npz").values()
    assert_back(demo, trajectory)


def test_trajectories_are_dictionaries(trajectory: pdmp.Trajectory) -> None:
    """A trajectory converts to a dictionary of named arrays."""
    values = trajectory.to_dict()
    assert list(values) == ["time", "position", "velocity", "acceleration", "names", "units"]
    given = {name: values[name] for name in ("position", "time", "names", "units")}
    assert_back(Demonstration(**given), trajectory)


def test_trajectories_are_data_frames(
    trajectory: pdmp.Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Data frames have the columns of the CSV file and time as index, and convert back."""
    pandas = pytest.importorskip("pandas")
    frame = trajectory.to_dataframe()
    assert frame.index.name == "t"
    assert list(frame) == [f"{x}{d}" for d in ("", "_velocity", "_acceleration") for x in "xy"]
    np.testing.assert_array_equal(frame["y_velocity"], trajectory.velocity[:, 1])
    assert_back(Demonstration(frame[trajectory.names], time=frame.index), trajectory)
    frame.to_csv(tmp_path / "a.csv")
    demo = pdmp.io.read_csv(tmp_path / "a.csv", columns=trajectory.names)
    np.testing.assert_array_equal(demo.position, trajectory.position)
    assert isinstance(frame, pandas.DataFrame)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="^data frames need pandas: pip install pandas$"):
        trajectory.to_dataframe()


def test_mappings_of_readers_are_accepted(tmp_path: Path) -> None:
    """Mappings of readers are accepted by fit, evaluation, plots and preprocessing."""
    listed = reaches()
    named = {f"d{m}": demo for m, demo in enumerate(listed)}
    model = pdmp.fit(named)
    np.testing.assert_array_equal(model.styles, pdmp.fit(listed).styles)
    found = pdmp.evaluate(named, predictors={})
    assert [demo.n_samples for demo in found.recordings.demos] == [d.n_samples for d in listed]
    for function, arguments in (
        (pdmp.preprocessing.lowpass, (5.0,)),
        (pdmp.preprocessing.resample, (0.03,)),
        (pdmp.preprocessing.trim, ()),
        (pdmp.preprocessing.unwrap, ()),
    ):
        of_named, of_listed = function(named, *arguments), function(listed, *arguments)
        assert list(of_named) == list(named)
        for one, other, demo in zip(of_named.values(), of_listed, listed, strict=True):
            expected = function(demo, *arguments).position
            np.testing.assert_array_equal(one.position, expected)
            np.testing.assert_array_equal(other.position, expected)
    parts = pdmp.preprocessing.split_at(named, [0.1, 0.5, 0.9])
    assert [len(part) for part in parts.values()] == [2] * len(named)
    with pytest.raises(ValueError, match="^d0: cut_off = -1"):
        pdmp.preprocessing.lowpass(named, -1.0)


def test_cycles_take_mappings() -> None:
    """Recordings and onsets by name are cut like those in a list."""
    (loop, *_) = loops()
    wave = Demonstration(np.tile(loop.position, (4, 1)), dt=loop.dt)
    period = loop.dt * loop.n_samples
    onsets = [0.0, period, 2 * period, 3 * period]
    listed = pdmp.preprocessing.cycles([wave, wave], onsets=[onsets, onsets])
    named = pdmp.preprocessing.cycles({"a": wave, "b": wave}, onsets={"b": onsets, "a": onsets})
    assert named.recordings == listed.recordings == [0] * 3 + [1] * 3
    for one, other in zip(named, listed, strict=True):
        np.testing.assert_array_equal(one.position, other.position)
    assert len(pdmp.preprocessing.cycles({"a": wave})) >= 3
    with pytest.raises(ValueError, match="onsets: 'c' is among"):
        pdmp.preprocessing.cycles({"a": wave}, onsets={"a": onsets, "c": onsets})
