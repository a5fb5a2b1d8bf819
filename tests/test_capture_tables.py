"""Tables of motion capture and of pandas are read at the first try."""

from pathlib import Path

import numpy as np
import pytest

import pdmp
import recorded
from recorded import RATE, TIME

MARKERS = ["Anna:LASI", "Anna:RASI"]
COORDINATES = [f"{name}.{axis}" for name in MARKERS for axis in "xyz"]
POSITION = recorded.path_of(7, 6)
ROWS = POSITION.tolist()
VICON = [
    "Devices",
    "1000",
    ",,Force Plate,,",
    "Frame,Sub Frame,Fx,Fy,Fz",
    ",,N,N,N",
    *(f"{13 + k // 10},{k % 10},1.0,2.0,{k}" for k in range(400)),
    "",
    "Trajectories",
    "100",
    ",,Anna:LASI,,,Anna:RASI,,,,,",
    "Frame,Sub Frame,X,Y,Z,X,Y,Z,X',Y',Z'",
    ",,mm,mm,mm,mm,mm,mm,mm/s,mm/s,mm/s",
    *(f"{13 + k},0," + ",".join(map(repr, row)) + ",1,1,1" for k, row in enumerate(ROWS)),
]
QUALISYS = [
    "NO_OF_FRAMES\t40",
    "NO_OF_CAMERAS\t8",
    "NO_OF_MARKERS\t2",
    "FREQUENCY\t100",
    "NO_OF_ANALOG\t0",
    "DESCRIPTION\t--",
    "TIME_STAMP\t2024-05-01, 10:12:13\t3.5",
    "DATA_INCLUDED\t3D",
    "MARKER_NAMES\tAnna:LASI\tAnna:RASI",
    *("\t".join(map(repr, row)) for row in ROWS),
]
TURNS = recorded.quaternions()
OPTITRACK = [
    "Format Version,1.23,Take Name,Reach 1,Capture Frame Rate,100.000000,Export Frame Rate,"
    "100.000000,Rotation Type,Quaternion,Length Units,Meters,Coordinate Space,Global",
    "",
    ",Type" + ",Rigid Body" * 8 + ",Rigid Body Marker" * 4,
    ",Name" + ",Hand" * 8 + ",Hand:Marker1" * 4,
    ",ID" + ",1" * 8 + ",2" * 4,
    ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,"
    "Position,Position,Position,Marker Quality",
    "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z,",
    *(
        ",".join(map(repr, [k, float(TIME[k]), *TURNS[k].tolist(), *ROWS[k][:3], 1e-4])) + ",,,,"
        for k in range(len(ROWS))
    ),
]


def read(tmp_path: Path, lines: list[str], name: str = "take.csv") -> pdmp.Demonstration:
    """Returns the demonstration read from lines of text."""
    (tmp_path / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    (demo,) = pdmp.io.read(tmp_path / name)
    return demo


@pytest.mark.parametrize("layout", ["commas", "semicolons"])
def test_trajectories_of_vicon_are_read(tmp_path: Path, layout: str) -> None:
    """The section of trajectories is read at its own rate, without velocities and frame numbers."""
    lines = VICON
    if layout == "semicolons":
        lines = [line.replace(",", ";").replace(".", ",") for line in VICON]
    demo = read(tmp_path, lines)
    np.testing.assert_array_equal(demo.position, POSITION)
    assert (demo.names, demo.units, demo.dt) == (COORDINATES, ["mm"] * 6, 1 / RATE)


def test_markers_of_qualisys_are_read(tmp_path: Path) -> None:
    """With and without columns of frame and time."""
    demo = read(tmp_path, QUALISYS, "take.tsv")
    np.testing.assert_array_equal(demo.position, POSITION)
    assert (demo.names, demo.units, demo.dt) == (COORDINATES, ["mm"] * 6, 1 / RATE)
    header = "Frame\tTime\t" + "\t".join(name.replace(".", " ") for name in COORDINATES)
    timed = [
        f"{k + 1}\t{t!r}\t{row}"
        for k, (t, row) in enumerate(zip(TIME.tolist(), QUALISYS[9:], strict=True))
    ]
    demo = read(tmp_path, [*QUALISYS[:9], header, *timed], "take.tsv")
    np.testing.assert_array_equal(demo.time, TIME)
    np.testing.assert_array_equal(demo.position, POSITION)
    with pytest.raises(ValueError, match="has 39 samples, but states 40"):
        read(tmp_path, QUALISYS[:-1], "take.tsv")


def test_bodies_of_optitrack_are_poses(tmp_path: Path) -> None:
    """Rotations are declared; errors and the markers of a body are read on demand alone."""
    demo = read(tmp_path, OPTITRACK)
    assert demo.names == [f"Hand.{axis}" for axis in ("qx", "qy", "qz", "qw", "x", "y", "z")]
    assert (demo.rotations, demo.units) == ({0: "xyzw"}, [""] * 4 + ["m"] * 3)
    np.testing.assert_array_equal(demo.position[:, 4:], POSITION[:, :3])
    np.testing.assert_allclose(demo.position[:, :4], TURNS, atol=1e-15)
    np.testing.assert_array_equal(demo.time, TIME)
    error = pdmp.io.read_csv(tmp_path / "take.csv", columns=["Hand.Mean Marker Error"])
    assert (error.position == 1e-4).all()


def test_a_marker_that_is_hidden_is_a_gap(tmp_path: Path) -> None:
    """Empty fields name the marker and the remedy, and are interpolated on demand."""
    lines = [
        *VICON[:-20],
        ",".join([*VICON[-20].split(",")[:5], "", "", "", "1", "1", "1"]),
        *VICON[-19:],
    ]
    with pytest.raises(ValueError, match=r"column 'Anna:RASI.x': empty: pass max_gap="):
        read(tmp_path, lines)
    filled = pdmp.io.read_csv(tmp_path / "take.csv", max_gap=0.03)
    assert np.abs(filled.position - POSITION).max() < 0.01


TIMES = {
    "timestamp": TIME,
    "Timestamp (ms)": 1000 * TIME,
    "time_s": TIME,
    "time_ms": 1000 * TIME,
    "Elapsed Time [s]": TIME,
    "seconds": TIME,
}


@pytest.mark.parametrize("name", TIMES)
def test_a_column_with_a_usual_name_is_the_time(tmp_path: Path, name: str) -> None:
    """It is read in its unit, and is no degree of freedom where dt is given either."""
    rows = [f"{t!r},{x!r},{y!r}" for t, (x, y, *_) in zip(TIMES[name].tolist(), ROWS, strict=True)]
    demo = read(tmp_path, [f"{name},x,y", *rows])
    np.testing.assert_allclose(demo.time, TIME, atol=1e-12)
    np.testing.assert_array_equal(demo.position, POSITION[:, :2])
    given = pdmp.io.read_csv(tmp_path / "take.csv", dt=0.01)
    assert (given.names, given.dt) == (["x", "y"], 0.01)


def test_dates_and_times_of_day_are_times(tmp_path: Path) -> None:
    """Stamps of loggers and of pandas are relative to the first, or to midnight."""
    stamps = [
        np.datetime64("2024-05-01T10:00:59.5") + np.timedelta64(10 * k, "ms") for k in range(40)
    ]
    for form in (
        lambda stamp: str(stamp).replace("T", " "),
        lambda stamp: f"{stamp}+02:00",
        lambda stamp: str(stamp).partition("T")[2],
    ):
        lines = [f"{form(stamp)},{x!r}" for stamp, (x, *_) in zip(stamps, ROWS, strict=True)]
        demo = read(tmp_path, ["time,x", *lines])
        np.testing.assert_allclose(demo.time - demo.time[0], TIME, atol=1e-9)
    with pytest.raises(ValueError, match="dates with a zone, without one, or numbers are mixed"):
        read(
            tmp_path,
            ["time,x", *(f"{stamp}{'Z' * (k == 3)},{k}" for k, stamp in enumerate(stamps))],
        )


def test_counters_are_no_degrees_of_freedom(tmp_path: Path) -> None:
    """A column that counts frames is left out unless it is asked for, another one is kept."""
    lines = [
        "Frame,t,x,step",
        *(f"{7 + k},{t!r},{k % 3},{k * k}" for k, t in enumerate(TIME.tolist())),
    ]
    assert read(tmp_path, lines).names == ["x", "step"]
    assert pdmp.io.read_csv(tmp_path / "take.csv", columns=["Frame"]).names == ["Frame"]


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    """The error is about the folder, not about its index."""
    with pytest.raises(FileNotFoundError) as caught:
        pdmp.io.read_folder(tmp_path / "missing")
    assert caught.value.filename == str(tmp_path / "missing")
    (tmp_path / "file.csv").write_text("t,x\n")
    with pytest.raises(NotADirectoryError):
        pdmp.io.read_folder(tmp_path / "file.csv")


def test_a_folder_of_any_formats_is_read(tmp_path: Path) -> None:
    """An index may list files of different formats, with their contexts."""
    (tmp_path / "demos").mkdir()
    read(tmp_path / "demos", VICON, "a.csv")
    recorded.write_c3d(tmp_path / "demos" / "b.c3d", POSITION, MARKERS)
    (tmp_path / "index.csv").write_text("id,speed\nb,1.5\na,2.5\n")
    demos = pdmp.io.read_folder(tmp_path, context=["speed"])
    assert {name: demo.context.tolist() for name, demo in demos.items()} == {"b": [1.5], "a": [2.5]}
    assert demos["a"].names == demos["b"].names == COORDINATES


def test_the_columns_of_an_index_name_the_contexts_of_a_model(tmp_path: Path) -> None:
    """They are kept by both readers of folders, unless contexts= replaces them."""
    (tmp_path / "demos").mkdir()
    lines = ["id,height,hand"]
    for k in range(4):
        table = recorded.path_of(k, 2)
        rows = np.column_stack([TIME, table])
        np.savetxt(
            tmp_path / "demos" / f"{k}.csv", rows, delimiter=",", header="t,x,y", comments=""
        )
        lines.append(f"{k},{0.1 * k},{'left' if k % 2 else 'right'}")
    (tmp_path / "index.csv").write_text("\n".join(lines))
    names = ["hand", "height"]
    demos = pdmp.io.read_folder(tmp_path, context=names)
    assert demos.contexts == {"hand": ["right", "left"] * 2, "height": [0.0, 0.1, 0.2, 0.1 * 3]}
    model = pdmp.fit(demos)
    assert (
        model.context_names
        == pdmp.fit(pdmp.io.read(tmp_path, context=names)).context_names
        == names
    )
    np.testing.assert_array_equal(
        model.predict({"height": 0.1, "hand": "left"}).conditions.goal,
        model.predict(["left", 0.1]).conditions.goal,
    )
    replaced = pdmp.fit(demos, contexts={"load": [1.0, 2.0, 3.0, 4.0]})
    assert replaced.context_names == ["load"]
    assert pdmp.fit(pdmp.io.read_folder(tmp_path)).context_names is None
