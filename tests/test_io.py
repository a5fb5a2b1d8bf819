"""Readers return complete demonstrations or one clear error; writers write complete files."""

import os
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import pdmp
from synthetic import BVH, reaches

TABLE = "t,x,y\n0.0,1,10\n0.1,2,20\n0.2,3,30\n0.4,4,40\n"
POSITION = np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 30.0], [4.0, 40.0]])
TIME = np.array([0.0, 0.1, 0.2, 0.4])


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Returns a CSV file of four samples."""
    path = tmp_path / "demo.csv"
    path.write_text(TABLE, encoding="utf-8")
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Returns a folder with an index of two demonstrations in CSV files."""
    (tmp_path / "demos").mkdir()
    (tmp_path / "index.csv").write_text("id,shape,height\na,C,0.1\nb,S,0.2\n")
    for name in "ab":
        (tmp_path / "demos" / f"{name}.csv").write_text(TABLE)
    return tmp_path


def test_csv_gives_positions_times_and_names(table: Path) -> None:
    """The column t is the time; all others are named degrees of freedom."""
    demo = pdmp.io.read_csv(table)
    np.testing.assert_array_equal(demo.position, POSITION)
    np.testing.assert_array_equal(demo.time, TIME)
    assert list(demo.names) == ["x", "y"]


def test_csv_columns_are_kept_in_the_order_asked_for(table: Path) -> None:
    """The argument columns selects and orders the degrees of freedom."""
    demo = pdmp.io.read_csv(table, columns=["y", "x"])
    np.testing.assert_array_equal(demo.position, POSITION[:, ::-1])


def test_csv_time_may_have_another_name(table: Path) -> None:
    """The argument time names the time column, and t becomes a degree of freedom."""
    demo = pdmp.io.read_csv(table, time="y [s]")
    np.testing.assert_array_equal(demo.time, POSITION[:, 1])
    assert list(demo.names) == ["t", "x"]


def test_dt_takes_the_place_of_time_stamps(table: Path) -> None:
    """With dt, a time column is neither needed nor a degree of freedom."""
    demo = pdmp.io.read_csv(table, dt=0.5)
    assert demo.dt == 0.5
    assert list(demo.names) == ["x", "y"]


def test_csv_of_spreadsheets_is_read(tmp_path: Path) -> None:
    """A byte order mark, spaces, blank lines and CRLF are accepted."""
    path = tmp_path / "demo.csv"
    path.write_bytes(b"\xef\xbb\xbf" + TABLE.replace(",", " , ").replace("\n", "\r\n\r\n").encode())
    np.testing.assert_array_equal(pdmp.io.read_csv(path).position, POSITION)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty"),
        ("0.0,1\n0.1,2\n", "line 1: '0.0' is not a name"),
        ("t,x,x\n", "two columns are called 'x'"),
        ("x,y\n1,2\n", "no column 't' with the time among x, y: .* pass dt="),
        (TABLE.replace("20", "2O"), "line 3, column 'y': '2O' is not a number"),
        (TABLE.replace("30", ""), "line 4, column 'y': empty: pass max_gap="),
        (TABLE.replace("40", "nan"), "line 5, column 'y': nan is not finite: pass max_gap="),
        (TABLE + "0.5,5\n", "line 6: 2 fields, expected 3"),
        (TABLE.replace("t,", "t [h],"), "its unit is 'h': expected s, sec, ms"),
        ("t,x\n0,1\n0.1,2\n", "2 samples"),
        (TABLE.replace("0.2", "0.1"), "time"),
    ],
)
def test_invalid_csv_is_rejected_with_file_and_location(
    tmp_path: Path, text: str, message: str
) -> None:
    """Every fault raises a ValueError that names the file and the location."""
    path = tmp_path / "broken.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=rf"broken\.csv.*{message}"):
        pdmp.io.read_csv(path)


def test_csv_in_another_encoding_is_rejected(tmp_path: Path) -> None:
    """Text that is not UTF-8 is rejected with this reason."""
    path = tmp_path / "latin.csv"
    path.write_bytes("t,höhe\n0,1\n".encode("latin-1"))
    with pytest.raises(ValueError, match=r"latin\.csv: not UTF-8"):
        pdmp.io.read_csv(path)


def test_missing_column_is_reported_with_the_available_ones(table: Path) -> None:
    """The error lists the available columns."""
    with pytest.raises(ValueError, match=r"no column 'z' among t, x, y"):
        pdmp.io.read_csv(table, columns=["z"])


def test_npz_gives_an_array_per_demonstration(tmp_path: Path) -> None:
    """Arrays are demonstrations under their names, with their time stamps under NAME.t."""
    path = tmp_path / "demos.npz"
    np.savez(path, **{"a": POSITION, "a.t": TIME, "b": 2 * POSITION, "b.t": TIME})
    found = pdmp.io.read_npz(path)
    assert list(found) == ["a", "b"]
    np.testing.assert_array_equal(found["b"].position, 2 * POSITION)
    np.testing.assert_array_equal(found["b"].time, TIME)


def test_npz_gives_demonstrations_stored_one_after_another(tmp_path: Path) -> None:
    """The array start has the first row of each; names select the columns."""
    path = tmp_path / "demos.npz"
    rows = np.concatenate([POSITION, POSITION + 1]).astype(np.float32)
    np.savez(path, y=rows, t=np.tile(TIME, 2), start=[0, 4, 8], names=["x", "y"])
    found = pdmp.io.read_npz(path, columns=["y"])
    assert list(found) == ["0", "1"]
    np.testing.assert_array_equal(found["1"].position, POSITION[:, 1:] + 1)


def test_npz_gives_time_and_position(tmp_path: Path) -> None:
    """The simplest layout is read; a stack has several demonstrations."""
    path = tmp_path / "demos.npz"
    np.savez(path, time=TIME, position=POSITION, velocity=POSITION, names=["x", "y"])
    (demo,) = pdmp.io.read_npz(path).values()
    np.testing.assert_array_equal(demo.position, POSITION)
    np.testing.assert_array_equal(demo.time, TIME)
    assert demo.names == ["x", "y"]
    np.savez(path, position=POSITION[:, 0])
    (demo,) = pdmp.io.read_npz(path, dt=0.5).values()
    np.testing.assert_array_equal(demo.position, POSITION[:, :1])
    for time in (TIME, np.array([TIME, 2 * TIME])):
        np.savez(path, time=time, position=np.array([POSITION, -POSITION]))
        found = pdmp.io.read_npz(path)
        np.testing.assert_array_equal(found["1"].position, -POSITION)
        np.testing.assert_array_equal(found["1"].time, time if time.ndim == 1 else time[1])


def test_npz_stamps_are_seconds(tmp_path: Path) -> None:
    """Stamps in ns since 1970 are recognised exactly; other long steps are rejected."""
    path, steps = tmp_path / "demos.npz", 10_000_000 * np.arange(4)
    np.savez(path, time=1_700_000_000_000_000_000 + steps, position=POSITION)
    with pytest.warns(UserWarning, match="read as ns since 1970"):
        (demo,) = pdmp.io.read_npz(path).values()
    np.testing.assert_allclose(demo.time, 0.01 * np.arange(4), atol=1e-15)
    np.savez(path, time=steps, position=POSITION)
    with pytest.raises(ValueError, match="store them in s instead of ns, or pass dt="):
        pdmp.io.read_npz(path)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"a": POSITION}, "'a': no time stamps: pass dt="),
        ({"a": POSITION[0], "a.t": TIME}, r"'a': shape \(2,\), expected \(T, D\)"),
        ({"a": POSITION, "a.t": TIME, "names": ["x"]}, r"shape \(4, 2\), expected \(T, 1\)"),
        ({"y": POSITION, "t": TIME, "start": [0, 9]}, "'start' must be whole .* rise from 0 to 4"),
        ({"y": POSITION, "t": TIME, "start": [0, 2]}, "'start' must be whole .* rise from 0 to 4"),
        ({"y": POSITION, "t": TIME, "start": [0, 0.5, 4]}, "the number of samples, got"),
        ({"y": POSITION, "t": TIME, "start": ["a", "b"]}, "the number of samples, got"),
        ({"y": POSITION, "t": TIME, "start": [0, np.inf]}, "the number of samples, got"),
        ({"y": POSITION, "t": TIME[:2], "start": [0, 4]}, r"'t' has shape \(2,\), expected \(4,\)"),
        ({"position": POSITION, "time": TIME[:2]}, "time has length 2, expected 4"),
        ({"position": np.array([POSITION] * 2), "time": [TIME[:2]] * 2}, "time has length 2"),
        ({"position": POSITION, "time": np.array([TIME] * 2)}, "time"),
        ({"position": POSITION.astype(str), "time": TIME}, "position has dtype"),
        ({"position": POSITION, "time": TIME.astype(str)}, "time has dtype"),
        ({"position": POSITION, "time": TIME, "names": [1, 2]}, "'names' must be a vector of"),
        ({"a.t": TIME}, "'a.t' has no positions 'a'"),
        ({"a": np.array([[None]])}, "not an NPZ file of plain arrays"),
        ({"a": POSITION, "a.t": TIME[::-1]}, "'a': time"),
    ],
)
def test_invalid_npz_is_rejected(tmp_path: Path, arrays: dict[str, object], message: str) -> None:
    """Every fault raises a ValueError that names the file and the array."""
    path = tmp_path / "broken.npz"
    np.savez(path, **arrays)
    with pytest.raises(ValueError, match=rf"broken\.npz.*{message}"):
        pdmp.io.read_npz(path)


def test_a_file_that_is_no_npz_is_rejected(tmp_path: Path) -> None:
    """Files that are not NPZ are rejected before any parser that could run them."""
    path = tmp_path / "broken.npz"
    path.write_bytes(b"PK\x03\x04 and nothing more")
    with pytest.raises(ValueError, match=r"broken\.npz: not an NPZ file"):
        pdmp.io.read_npz(path)


def test_folder_gives_demonstrations_by_id_with_their_context(folder: Path) -> None:
    """Columns of the index form the context."""
    found = pdmp.io.read_folder(folder, context=["height"])
    assert list(found) == ["a", "b"]
    np.testing.assert_array_equal(found["b"].context, [0.2])


def test_folder_can_have_an_npz(folder: Path) -> None:
    """A demos.npz is read in the order of the index."""
    rows = np.concatenate([POSITION, POSITION + 1])
    np.savez(folder / "demos.npz", y=rows, t=np.tile(TIME, 2), start=[0, 4, 8])
    found = pdmp.io.read_folder(folder, context=["height"])
    np.testing.assert_array_equal(found["b"].position, POSITION + 1)
    np.testing.assert_array_equal(found["b"].context, [0.2])


def test_npz_and_index_must_agree(folder: Path) -> None:
    """A number of demonstrations other than in the index is rejected."""
    np.savez(folder / "demos.npz", y=POSITION, t=TIME, start=[0, 4])
    with pytest.raises(ValueError, match=r"has 1 demonstrations, but index\.csv lists 2"):
        pdmp.io.read_folder(folder)


@pytest.mark.parametrize("place", [".", "demos"])
def test_folder_without_an_index_is_read_by_its_files(tmp_path: Path, place: str) -> None:
    """Files are read in natural order of their names; a context needs an index."""
    (tmp_path / place).mkdir(exist_ok=True)
    for name in ("take 10", "take 9", "b"):
        (tmp_path / place / f"{name}.csv").write_text(TABLE)
    assert list(pdmp.io.read_folder(tmp_path)) == ["b", "take 9", "take 10"]
    assert len(pdmp.io.read(tmp_path)) == 3
    with pytest.raises(ValueError, match=r"no index\.csv: expected an index\.csv with a row per"):
        pdmp.io.read_folder(tmp_path, context=["height"])


def test_folder_without_demonstrations_is_rejected_with_the_format(tmp_path: Path) -> None:
    """A folder without demonstrations is rejected with the expected format."""
    with pytest.raises(ValueError, match=r"and no files: expected an index\.csv .*demos/<id>\.csv"):
        pdmp.io.read_folder(tmp_path)
    (tmp_path / "index.csv").write_text("id,height\n")
    with pytest.raises(ValueError, match=r"lists no demonstrations: expected an index\.csv"):
        pdmp.io.read_folder(tmp_path)
    with pytest.raises(FileNotFoundError):
        pdmp.io.read_folder(tmp_path / "none")


@pytest.mark.parametrize(
    "name", ["../a", "/etc/passwd", "a/../a", "x/a", "..", ".", r"..\a", "C:a", "a\x00b", '""']
)
def test_id_names_a_file_in_the_folder(folder: Path, name: str) -> None:
    """An id cannot lead outside the folder; the error states the format."""
    (folder / "a.csv").write_text(TABLE)
    (folder / "index.csv").write_text(f"id,height\n{name},1\n")
    with pytest.raises(ValueError, match=r"index\.csv.* is not a file name: expected an index"):
        pdmp.io.read_folder(folder)


def test_id_can_be_the_name_of_the_file(folder: Path) -> None:
    """An id may include the suffix of its file."""
    (folder / "index.csv").write_text("id;height\na.csv;0,5\nb;1\n")
    found = pdmp.io.read_folder(folder, context=["height"])
    assert [demo.context.tolist() for demo in found.values()] == [[0.5], [1.0]]


def test_index_of_pandas_is_read(folder: Path) -> None:
    """A first column without a name is ignored."""
    (folder / "index.csv").write_text(",id,height\n0,a,0.1\n1,b,0.2\n")
    assert pdmp.io.read_folder(folder, context=["height"])["b"].context == [0.2]


def test_context_may_be_labels(folder: Path) -> None:
    """A column of words gives labels."""
    found = pdmp.io.read_folder(folder, context=["shape", "height"])
    assert found["a"].context == ["C", 0.1]


def test_context_is_all_numbers_or_all_labels(folder: Path) -> None:
    """A word among numbers is rejected with its location."""
    index = folder / "index.csv"
    index.write_text(index.read_text().replace("0.1", "low"))
    with pytest.raises(ValueError, match=r"index\.csv, line 2, column 'height': 'low' is not a n"):
        pdmp.io.read_folder(folder, context=["height"])


def test_label_must_not_be_missing(folder: Path) -> None:
    """An empty field or a mark of a missing number is not a label."""
    (folder / "index.csv").write_text("id,height\na,NA\nb,1\n")
    with pytest.raises(ValueError, match=r"index\.csv, line 2, column 'height': no number"):
        pdmp.io.read_folder(folder, context=["height"])
    (folder / "index.csv").write_text("id,hand [side]\na,left\nb,\n")
    with pytest.raises(ValueError, match=r"index\.csv, line 3, column 'hand': no label"):
        pdmp.io.read_folder(folder, context=["hand"])


def test_id_must_be_unique(folder: Path) -> None:
    """Two rows of the index with the same id are rejected."""
    (folder / "index.csv").write_text("id\na\na\n")
    with pytest.raises(ValueError, match=r"line 3: id 'a' appears twice"):
        pdmp.io.read_folder(folder)


def test_read_takes_files_and_folders_together(folder: Path) -> None:
    """Demonstrations are in the order of the paths."""
    single = folder / "demos" / "a.csv"
    assert len(pdmp.io.read([single, folder, single])) == 4
    assert len(pdmp.io.read(single)) == 1


def test_read_rejects_unknown_formats(tmp_path: Path) -> None:
    """Another suffix is rejected with the supported ones."""
    (tmp_path / "demo.doc").touch()
    with pytest.raises(ValueError, match=r"expected a folder or a file of one of \.csv"):
        pdmp.io.read([tmp_path / "demo.doc"])
    with pytest.raises(FileNotFoundError, match="No such file or directory: .*none"):
        pdmp.io.read([tmp_path / "none"])


def test_context_needs_an_index(table: Path) -> None:
    """A context of a single file is rejected rather than ignored."""
    with pytest.raises(ValueError, match=r"index\.csv"):
        pdmp.io.read([table], context=["height"])


def test_names_come_in_a_list(table: Path, folder: Path) -> None:
    """A single text is not read as a list of letters."""
    with pytest.raises(ValueError, match=r"columns = 'xy': pass a list of names, \['xy'\]"):
        pdmp.io.read_csv(table, columns="xy")
    with pytest.raises(ValueError, match="context = 'height': pass a list"):
        pdmp.io.read_folder(folder, context="height")


@pytest.mark.parametrize(
    ("header", "second"), [("t [ms]", 1e-3), ("t (ms)", 1e-3), ("t [ns]", 1e-9)]
)
def test_time_has_its_unit(table: Path, header: str, second: float) -> None:
    """Time stamps have the unit in their header, in brackets or parentheses."""
    table.write_text(TABLE.replace("t,", f"{header},", 1))
    name = header if "(" in header else "t"
    time = pdmp.io.read_csv(table, time=name).time
    np.testing.assert_allclose(time, second * TIME, rtol=1e-15)


def test_missing_file_is_an_os_error(tmp_path: Path) -> None:
    """A missing file raises OSError."""
    with pytest.raises(FileNotFoundError):
        pdmp.io.read([tmp_path / "none.csv"])


@pytest.mark.parametrize("names", [["1", "2"], ["t", "x"], ["x", "x_velocity"], [" ", "x"]])
def test_csv_that_cannot_be_read_is_not_written(tmp_path: Path, names: list[str]) -> None:
    """Names that `read_csv` rejects are rejected by the writer."""
    with pytest.raises(ValueError, match="is not a name|two columns are called"):
        pdmp.io.write_csv(tmp_path / "out.csv", pdmp.fit(reaches()).rollout(), names)
    assert not (tmp_path / "out.csv").exists()


def test_target_of_a_link_is_replaced(tmp_path: Path) -> None:
    """The target of a link is replaced, and the link stays, for tables and model files."""
    model = pdmp.fit(reaches())
    for name, write in (
        ("table", lambda path: pdmp.io.write_csv(path, model.rollout(), model.names)),
        ("model", model.save),
    ):
        file, link = tmp_path / name, tmp_path / f"{name}-link"
        file.write_text("older")
        link.symlink_to(file)
        write(link)
        assert link.is_symlink() and len(file.read_bytes()) > 100
        file.unlink()
        write(link)
        assert link.is_symlink() and len(file.read_bytes()) > 100


@pytest.mark.parametrize("older", [None, 0o600, 0o664])
def test_files_have_the_mode_of_others(tmp_path: Path, older: int | None) -> None:
    """A new file has the default mode of the process; a replaced file keeps its mode."""
    model = pdmp.fit(reaches())
    before = os.umask(0o027)
    try:
        for name, write in (
            ("table", lambda path: pdmp.io.write_csv(path, model.rollout(), model.names)),
            ("model", model.save),
        ):
            path = tmp_path / name
            if older is not None:
                path.touch()
                path.chmod(older)
            write(path)
            assert path.stat().st_mode & 0o777 == (0o640 if older is None else older)
    finally:
        os.umask(before)


def test_pipes_are_written_to(tmp_path: Path) -> None:
    """A pipe is written, not replaced, for tables and models."""
    model, pipe = pdmp.fit(reaches()), tmp_path / "pipe"
    os.mkfifo(pipe)
    for write in (
        lambda: pdmp.io.write_csv(pipe, model.rollout(), model.names),
        lambda: model.save(pipe),
    ):
        writer = threading.Thread(target=write)
        writer.start()
        assert len(pipe.read_bytes()) > 100
        writer.join()
    assert pipe.is_fifo()


def test_folder_is_no_file(tmp_path: Path) -> None:
    """A folder in place of a file is named in the error."""
    with pytest.raises(IsADirectoryError, match=tmp_path.name):
        pdmp.io.write_csv(tmp_path, pdmp.fit(reaches()).rollout(), ["x", "y"])


def test_written_csv_reads_back_to_the_last_bit(tmp_path: Path) -> None:
    """Positions and times are equal after a round trip."""
    model = pdmp.fit(reaches())
    trajectory = model.rollout()
    pdmp.io.write_csv(tmp_path / "out.csv", trajectory, model.names)
    demo = pdmp.io.read_csv(tmp_path / "out.csv", columns=model.names)
    np.testing.assert_array_equal(demo.position, trajectory.position)
    np.testing.assert_array_equal(demo.time, trajectory.time)


def test_interrupted_write_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C just before the end leaves the former file, without a temporary one."""
    trajectory = pdmp.fit(reaches()).rollout()

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    path = tmp_path / "out.csv"
    path.write_text("before")
    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        pdmp.io.write_csv(path, trajectory, ["x", "y"])
    assert path.read_text() == "before"
    assert os.listdir(tmp_path) == ["out.csv"]


def test_each_dof_needs_a_name(tmp_path: Path) -> None:
    """A wrong number of names is rejected before writing."""
    with pytest.raises(ValueError, match="names has length 1, expected 2"):
        pdmp.io.write_csv(tmp_path / "out.csv", pdmp.fit(reaches()).rollout(), ["x"])
    assert os.listdir(tmp_path) == []


def test_written_csv_keeps_units(tmp_path: Path) -> None:
    """Headers have the units, which reading separates from the names."""
    model = pdmp.fit(reaches())
    pdmp.io.write_csv(tmp_path / "out.csv", model.rollout(), model.names, model.units)
    header = (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()[0]
    assert header.startswith("t,x [m],y [m],x_velocity [m/s],")
    demo = pdmp.io.read_csv(tmp_path / "out.csv", columns=["y", "x_velocity"])
    assert (demo.names, demo.units) == (["y", "x_velocity"], ["m", "m/s"])


def test_csv_headers_have_units(tmp_path: Path) -> None:
    """Units are separated from names, and a time in ms is converted to s."""
    path = tmp_path / "demo.csv"
    path.write_text("t [ms],knee [rad],height[m],count\n0,1,2,3\n1,1,2,3\n2,1,2,3\n3,1,2,3\n")
    demo = pdmp.io.read_csv(path)
    assert (demo.names, demo.units) == (["knee", "height", "count"], ["rad", "m", ""])
    np.testing.assert_allclose(demo.time, [0, 0.001, 0.002, 0.003])
    path.write_text("t [min],x\n0,1\n1,1\n2,1\n3,1\n")
    with pytest.raises(ValueError, match=r"demo\.csv, column 't': its unit is 'min': expected s"):
        pdmp.io.read_csv(path)
    path.write_text("t,x [m],x [rad]\n")
    with pytest.raises(ValueError, match="two columns are called 'x'"):
        pdmp.io.read_csv(path)


@pytest.mark.parametrize("gap", ["", "nan", "NaN"])
def test_csv_gaps_are_interpolated_up_to_a_length(tmp_path: Path, gap: str) -> None:
    """Gaps are interpolated between neighbours; longer ones are rejected with their location."""
    path = tmp_path / "demo.csv"
    rows = [f"{0.1 * k:.1f},{k},{gap if k in (3, 4) else k**3}" for k in range(8)]
    path.write_text("\n".join(["t,x,y", *rows]))
    filled = pdmp.io.read_csv(path, max_gap=0.3).position
    np.testing.assert_allclose(filled[:, 1], np.arange(8.0) ** 3, atol=1e-9)
    place = r"demo\.csv: column 'y': no sample between t = 0\.2 s and t = 0\.5 s"
    with pytest.raises(ValueError, match=place):
        pdmp.io.read_csv(path, max_gap=0.2)
    with pytest.raises(ValueError, match=r"demo\.csv, line 5, column 'y'"):
        pdmp.io.read_csv(path)
    with pytest.raises(ValueError, match="max_gap = -1"):
        pdmp.io.read_csv(path, columns=["x"], max_gap=-1)


def test_npz_has_units_and_gaps(tmp_path: Path) -> None:
    """The array units is read like names; NaN is a gap, rejected unless allowed."""
    path = tmp_path / "demos.npz"
    holed = np.arange(16.0).reshape(8, 2) / 10
    holed[3, 1] = np.nan
    np.savez(path, reach=holed, names=["x", "yaw"], units=["m", "rad"])
    (demo,) = pdmp.io.read_npz(path, dt=0.1, max_gap=0.2, columns=["yaw"]).values()
    assert demo.units == ["rad"]
    np.testing.assert_allclose(demo.position[:, 0], np.arange(8) * 0.2 + 0.1)
    with pytest.raises(ValueError, match=r"npz, 'reach': column 'yaw': no sample between t = 0\.2"):
        pdmp.io.read_npz(path, dt=0.1)
    np.savez(path, reach=holed, names=["x", "yaw"], units=["m"])
    with pytest.raises(ValueError, match=r"'reach': shape \(8, 2\), expected \(T, 1\)"):
        pdmp.io.read_npz(path, dt=0.1)


@pytest.fixture
def bvh(tmp_path: Path) -> Path:
    """Returns a BVH file of two joints and four frames, without a final line break."""
    path = tmp_path / "leg.bvh"
    path.write_text(BVH)
    return path


def test_bvh_gives_every_channel_unwrapped(bvh: Path) -> None:
    """Angles are in rad, without wrapping, and positions unchanged, for any joint."""
    demo = pdmp.io.read_bvh(bvh)
    assert demo.dt == 0.01
    assert demo.names is not None
    assert demo.names[1] == "Hips.Yposition"
    assert demo.names[6:] == [f"Left Leg.{channel}" for channel in BVH.split("4 ")[1].split()[:4]]
    np.testing.assert_array_equal(demo.position[:, 1], [90, 91, 92, 93])
    np.testing.assert_allclose(np.rad2deg(demo.position[:, 8]), [-170, -180, -190, -200])
    assert demo.units == [""] * 3 + ["rad"] * 3 + [""] + ["rad"] * 3


def test_bvh_angles_have_no_jumps_by_full_turns(bvh: Path) -> None:
    """Programs write angles within a turn; the movement goes on beyond it."""
    text = BVH
    for angle in (-190, -200):
        text = text.replace(str(angle), str(angle + 360))
    assert text != BVH
    bvh.write_text(text)
    demo = pdmp.io.read_bvh(bvh)
    np.testing.assert_allclose(np.rad2deg(demo.position[:, 8]), [-170, -180, -190, -200])


def test_bvh_is_read_like_csv(bvh: Path) -> None:
    """BVH files are read among files, and in a folder by the ids of its index."""
    (demo,) = pdmp.io.read([bvh], columns=["Left Leg.Zrotation"])
    assert demo.position.shape == (4, 1)
    (bvh.parent / "demos").mkdir()
    bvh.rename(bvh.parent / "demos" / "leg.bvh")
    (bvh.parent / "index.csv").write_text("id,speed\nleg,1.5\n")
    demo = pdmp.io.read_folder(bvh.parent, context=["speed"])["leg"]
    assert demo.context == [1.5]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (BVH, "", "an incomplete BVH file"),
        ("}\nMOTION", "}}\nMOTION", "an incomplete BVH file"),
        ("CHANNELS 4", "CHANNEL 4", "an incomplete BVH file"),
        ("Frames:\t4", "Frames:\t5", "has 4 frames, but states 5"),
        ("-190 5", "-190", r"frame 2: 9 numbers, expected 10"),
        ("-190", "l90", r"frame 2, 'Left Leg\.Xrotation': 'l90' is not a number"),
        ("Time: 0.01", "Time: 0", "dt = 0"),
    ],
)
def test_invalid_bvh_is_rejected_with_file_and_location(
    bvh: Path, old: str, new: str, message: str
) -> None:
    """Every fault raises a ValueError that names the file and the location."""
    bvh.write_text(BVH.replace(old, new))
    with pytest.raises(ValueError, match=rf"leg\.bvh.*{message}"):
        pdmp.io.read_bvh(bvh)


def test_missing_bvh_package_is_named(bvh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the extra, the error names it."""
    monkeypatch.setitem(sys.modules, "bvh", None)
    with pytest.raises(ImportError, match=r"^BVH files need .*: pip install 'pdmp\[bvh\]'$"):
        pdmp.io.read_bvh(bvh)
