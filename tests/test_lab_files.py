"""Recordings of laboratories are read: C3D, OpenSim, MAT, Parquet, data frames and xarray."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas
import polars
import pytest
import scipy.io
import xarray

import pdmp
import recorded
from pdmp.io import _c3d_file
from recorded import RATE, TIME

MARKERS = ["LASI", "RASI"]
COORDINATES = [f"{name}.{axis}" for name in MARKERS for axis in "xyz"]
POSITION = recorded.path_of(4, 6)


def test_markers_are_read_with_unit_and_rate(tmp_path: Path) -> None:
    """A file of ezc3d gives its points in single precision."""
    path = recorded.write_c3d(tmp_path / "walk.c3d", POSITION, MARKERS)
    (demo,) = pdmp.io.read([path])
    np.testing.assert_array_equal(demo.position, POSITION.astype("f4"))
    assert (demo.names, demo.units, demo.dt) == (COORDINATES, ["mm"] * 6, 1 / RATE)


def test_hidden_markers_are_gaps(tmp_path: Path) -> None:
    """A marker without coordinates is refused, or interpolated over a gap that is allowed."""
    hidden = POSITION.copy()
    hidden[10:13, 3:] = np.nan
    path = recorded.write_c3d(tmp_path / "walk.c3d", hidden, MARKERS)
    with pytest.raises(ValueError, match="RASI.x.*max_gap"):
        pdmp.io.read_c3d(path)
    filled = pdmp.io.read_c3d(path, max_gap=0.05)
    assert np.abs(filled.position - POSITION).max() < 0.01
    assert pdmp.io.read_c3d(path, columns=["LASI.z"]).names == ["LASI.z"]


@pytest.mark.parametrize("processor", [_c3d_file.INTEL, _c3d_file.DEC, _c3d_file.MIPS])
def test_numbers_of_every_processor_are_decoded(processor: int) -> None:
    """1 and -0.15625 in the bytes of each processor."""
    reals = {
        _c3d_file.INTEL: "0000803f 000020be",
        _c3d_file.DEC: "80400000 20bf0000",
        _c3d_file.MIPS: "3f800000 be200000",
    }
    numbers = _c3d_file.Numbers(processor)
    data = bytes.fromhex(reals[processor])
    np.testing.assert_array_equal(numbers.decode(data, 4, real=True), [1.0, -0.15625])


def test_many_markers_and_frames_are_read(tmp_path: Path) -> None:
    """Labels beyond 255 and frames beyond the 16 bits of the header are read."""
    labels = [f"M{k}" for k in range(300)]
    position = recorded.path_of(1, 900, 20)
    demo = pdmp.io.read_c3d(recorded.write_c3d(tmp_path / "many.c3d", position, labels))
    np.testing.assert_array_equal(demo.position, position.astype("f4"))
    long = recorded.path_of(2, 3, 70_000)
    demo = pdmp.io.read_c3d(recorded.write_c3d(tmp_path / "long.c3d", long, ["A"]))
    np.testing.assert_array_equal(demo.position, long.astype("f4"))


TRC = "\n".join(
    [
        "PathFileType\t4\t(X/Y/Z)\twalk.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame",
        "100\t100\t40\t2\tmm\t100\t1",
        "Frame#\tTime\tLASI\t\t\tRASI\t\t\t",
        "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\t",
        "",
        *(
            f"{k + 1}\t{t!r}\t" + "\t".join(map(repr, row)) + "\t"
            for k, (t, row) in enumerate(zip(TIME.tolist(), POSITION.tolist(), strict=True))
        ),
    ]
)
STO_NAMES = ["hip_flexion_r", "pelvis_tx", "ground_force_vy", "knee_angle_r", "a", "b"]
STO = "\n".join(
    [
        "Coordinates",
        "version=1",
        "nRows=40",
        "nColumns=7",
        "inDegrees=yes",
        "",
        "endheader",
        "\t".join(["time", *STO_NAMES]),
        *(
            "\t".join(map(repr, [t, *row]))
            for t, row in zip(TIME.tolist(), POSITION.tolist(), strict=True)
        ),
    ]
)


def test_files_of_opensim_are_read_with_units(tmp_path: Path) -> None:
    """Markers of TRC and coordinates of MOT are read bit for bit."""
    (tmp_path / "walk.trc").write_text(TRC)
    (tmp_path / "walk.mot").write_text(STO)
    (tmp_path / "walk.sto").write_text(STO.replace("\t", "   "))
    markers, motion, spaced = pdmp.io.read([tmp_path / f"walk.{s}" for s in ("trc", "mot", "sto")])
    for demo in (markers, motion, spaced):
        np.testing.assert_array_equal(demo.position, POSITION)
        np.testing.assert_array_equal(demo.time, TIME)
    assert (markers.names, markers.units) == (COORDINATES, ["mm"] * 6)
    assert motion.names == spaced.names == STO_NAMES
    assert motion.units == ["deg", "m", "", "deg", "deg", "deg"]


@pytest.mark.parametrize("text", [TRC, STO], ids=["trc", "sto"])
def test_a_file_of_opensim_with_fewer_rows_than_stated_is_refused(
    tmp_path: Path, text: str
) -> None:
    """A file that was cut between two rows is not read as a shorter movement."""
    path = tmp_path / "cut.trc"
    path.write_text(text.rpartition("\n")[0])
    with pytest.raises(ValueError, match="has 39 samples, but states 40"):
        pdmp.io.read_opensim(path)


CELLS = np.empty(2, object)
CELLS[:] = [{"pos": POSITION.T, "t": TIME}, {"pos": POSITION.T + 1, "t": TIME}]
LAYOUTS = {
    "matrix and time": {"position": POSITION, "time": TIME},
    "columns of time": {"Q": POSITION.T, "t": TIME[:, None]},
    "matrix and interval": {"pos": POSITION.T, "Ts": 0.01},
    "struct": {"demo": {"y": POSITION, "t": TIME}},
    "cells of structs": {"demos": CELLS, "n": 2},
    "array of several": {"q": np.dstack([POSITION, POSITION + 1]), "dt": 0.01},
    "names": {"q": POSITION, "t": TIME, "names": COORDINATES},
}


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_every_layout_of_matlab_is_read(tmp_path: Path, layout: dict[str, object]) -> None:
    """Samples may be rows or columns, in matrices, structs and cells."""
    path = tmp_path / "demos.mat"
    scipy.io.savemat(path, layout)
    demos = pdmp.io.read_mat(path)
    assert list(demos) == [str(k) for k in range(len(demos))]
    for k, demo in enumerate(demos.values()):
        np.testing.assert_array_equal(demo.position, POSITION + k)
        np.testing.assert_allclose(demo.time, TIME, atol=1e-15)
    assert demos["0"].names == (COORDINATES if "names" in layout else [f"y{d}" for d in range(6)])


def test_other_layouts_of_matlab_are_refused(tmp_path: Path) -> None:
    """The error says which variables there are and which layout is expected."""
    path = tmp_path / "demos.mat"
    for variables, message in [
        ({"a": POSITION, "b": POSITION}, "pass variable= one of a, b: store position"),
        ({"position": "text"}, "'position' is not an array of real numbers"),
        ({"demo": {"force": POSITION}}, "no positions among force: store position"),
        ({"position": POSITION}, "no time stamps: pass dt="),
    ]:
        scipy.io.savemat(path, variables)
        with pytest.raises(ValueError, match=message):
            pdmp.io.read_mat(path)
    assert len(pdmp.io.read_mat(path, variable="position", dt=0.01)) == 1
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + bytes(200))
    with pytest.raises(ValueError, match="version 7.3: save it by"):
        pdmp.io.read_mat(path)


def trials() -> pandas.DataFrame:
    """Returns three trials below each other."""
    return pandas.concat(
        [
            pandas.DataFrame(
                {
                    "trial": f"r{k}",
                    "frame": range(7, 47),
                    "load": 0.5 * k,
                    "t": TIME + 3,
                    "x [m]": recorded.path_of(k, 2)[:, 0],
                    "knee": recorded.path_of(k, 2)[:, 1],
                    "note": "good",
                }
            )
            for k in range(3)
        ]
    )


@pytest.mark.parametrize("package", ["pandas", "polars"])
def test_trials_in_a_data_frame_are_demonstrations(package: str) -> None:
    """Each has its own rows, names, units, times and context."""
    frame = trials() if package == "pandas" else polars.from_pandas(trials())
    demos = pdmp.io.from_dataframe(frame, by="trial", context=["load"])
    assert list(demos) == ["r0", "r1", "r2"]
    for k, demo in enumerate(demos.values()):
        np.testing.assert_array_equal(demo.position, recorded.path_of(k, 2))
        np.testing.assert_allclose(demo.time, TIME + 3)
        assert (demo.names, demo.units, demo.context.tolist()) == (
            ["x", "knee"],
            ["m", ""],
            [0.5 * k],
        )


INDICES = {
    "times": pandas.Index(TIME),
    "named times": pandas.Index(TIME, name="time"),
    "ms": pandas.Index(1000 * TIME, name="time [ms]"),
    "differences": pandas.to_timedelta(TIME, unit="s"),
    "dates": pandas.Timestamp("2024-05-01 10:00") + pandas.to_timedelta(TIME, unit="s"),
}


@pytest.mark.parametrize("index", INDICES.values(), ids=INDICES)
def test_the_index_of_a_data_frame_is_its_time(tmp_path: Path, index: pandas.Index) -> None:
    """An index of times is the time, in the files that pandas writes too."""
    frame = pandas.DataFrame(POSITION, columns=COORDINATES, index=index)
    frame.to_csv(tmp_path / "frame.csv")
    frame.to_parquet(tmp_path / "frame.parquet")
    demos = [
        *pdmp.io.from_dataframe(frame).values(),
        *pdmp.io.read([tmp_path / "frame.csv", tmp_path / "frame.parquet"]),
    ]
    assert len(demos) == 3
    for demo in demos:
        np.testing.assert_array_equal(demo.position, POSITION)
        np.testing.assert_allclose(demo.time, TIME, atol=1e-9)
        assert demo.names == COORDINATES


def test_a_trajectory_is_read_back_from_its_data_frame_and_parquet(tmp_path: Path) -> None:
    """Positions, names, units and times return; velocities are not degrees of freedom."""
    model = pdmp.fit(pdmp.io.from_dataframe(trials(), by="trial", context=["load"]))
    trajectory = model.rollout(style=model.styles[0])
    pdmp.io.write_parquet(tmp_path / "out.parquet", trajectory)
    (framed,) = pdmp.io.from_dataframe(trajectory.to_dataframe()).values()
    for demo in (framed, pdmp.io.read_parquet(tmp_path / "out.parquet")):
        np.testing.assert_array_equal(demo.position, trajectory.position)
        np.testing.assert_array_equal(demo.time, trajectory.time)
        assert (demo.names, demo.units) == (["x", "knee"], ["m", ""])


def test_data_frames_that_do_not_say_enough_are_refused() -> None:
    """A missing time, a context that varies and a missing column are named."""
    frame = trials()
    with pytest.raises(ValueError, match="no column 't' with the time among trial, frame"):
        pdmp.io.from_dataframe(frame.drop(columns="t"), by="trial")
    with pytest.raises(ValueError, match="trial r0: 'knee' varies, but is its context"):
        pdmp.io.from_dataframe(frame, by="trial", context=["knee"])
    with pytest.raises(ValueError, match="no column 'hip' among trial"):
        pdmp.io.from_dataframe(frame, by="trial", columns=["hip"])
    with pytest.raises(ValueError, match="trial r0: a column that is not numeric is kept"):
        pdmp.io.from_dataframe(frame, by="trial", columns=["note"])
    with pytest.raises(TypeError, match="expected a data frame"):
        pdmp.io.from_dataframe(POSITION)


def test_a_column_of_time_among_positions_is_reported() -> None:
    """A data frame passed as positions warns and names the reader of times."""
    frame = trials().loc[:, ["t", "knee"]]
    with pytest.warns(UserWarning, match="the column 't' of a data frame becomes a degree"):
        demo = pdmp.Demonstration(frame, dt=0.01)
    assert demo.names == ["t", "knee"]


def test_labelled_arrays_are_demonstrations() -> None:
    """Markers by trial and time, and data sets of several variables."""
    array = xarray.DataArray(
        np.stack([POSITION.reshape(-1, 2, 3) + k for k in range(3)]),
        dims=["trial", "time", "marker", "axis"],
        coords={
            "trial": ["a", "b", "c"],
            "time": TIME,
            "marker": MARKERS,
            "axis": list("xyz"),
            "load": ("trial", [1.0, 2.0, 3.0]),
        },
        attrs={"units": "mm"},
    )
    demos = pdmp.io.from_xarray(array, by="trial", context=["load"])
    assert list(demos) == ["a", "b", "c"]
    for k, demo in enumerate(demos.values()):
        np.testing.assert_array_equal(demo.position, POSITION + k)
        np.testing.assert_array_equal(demo.time, TIME)
        assert (demo.names, demo.units) == (COORDINATES, ["mm"] * 6)
        assert demo.context.tolist() == [k + 1]
    padded = array.copy()
    padded[1, 30:] = np.nan
    single = padded.drop_vars(["marker", "axis"])
    data = xarray.Dataset({"knee": single[:, :, 0, 0], "hip": single[:, :, 1, 2]})
    data["knee"].attrs["units"] = "rad"
    short = pdmp.io.from_xarray(data, by="trial")["b"]
    assert (short.n_samples, short.names, short.units) == (30, ["knee", "hip"], ["rad", "mm"])
    with pytest.raises(ValueError, match="no dimension 't' of time: name it with time= among x, y"):
        pdmp.io.from_xarray(xarray.DataArray(POSITION, dims=["x", "y"]))


def test_damaged_c3d_files_end_in_time(tmp_path: Path) -> None:
    """Every length of a file is refused at once; ezc3d does not return from some of them."""
    path = recorded.write_c3d(tmp_path / "walk.c3d", POSITION, MARKERS)
    data = path.read_bytes()
    for size in range(0, len(data), 7):
        path.write_bytes(data[:size])
        try:
            demo = pdmp.io.read_c3d(path)
        except ValueError as error:
            assert "walk.c3d: " in str(error)
        else:
            np.testing.assert_array_equal(demo.position, POSITION.astype("f4"))


def test_the_reader_of_c3d_needs_no_package() -> None:
    """The extra is for tests alone."""
    code = "import sys; sys.modules['ezc3d'] = None; import pdmp; pdmp.io.read_c3d"
    subprocess.run([sys.executable, "-c", code], check=True)
