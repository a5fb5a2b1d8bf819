"""Demonstrations come in from files whole or with one clear error; trajectories go out whole."""

import os
from pathlib import Path

import numpy as np
import pytest

import pdmp
from pdmp import demos
from synthetic import reaches

TABLE = "t,x,y\n0.0,1,10\n0.1,2,20\n0.2,3,30\n0.4,4,40\n"
POSITION = np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 30.0], [4.0, 40.0]])
TIME = np.array([0.0, 0.1, 0.2, 0.4])


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Return a CSV file of four samples."""
    path = tmp_path / "demo.csv"
    path.write_text(TABLE, encoding="utf-8")
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with an index of two demonstrations in CSV files."""
    (tmp_path / "demos").mkdir()
    (tmp_path / "index.csv").write_text("id,shape,height\na,C,0.1\nb,S,0.2\n")
    for name in "ab":
        (tmp_path / "demos" / f"{name}.csv").write_text(TABLE)
    return tmp_path


def test_csv_gives_positions_times_and_names(table: Path) -> None:
    """The column t is the time; all others are degrees of freedom under their names."""
    demo = demos.read_csv(table)
    np.testing.assert_array_equal(demo.position, POSITION)
    np.testing.assert_array_equal(demo.time, TIME)
    assert list(demo.names) == ["x", "y"]


def test_csv_columns_are_kept_in_the_order_asked_for(table: Path) -> None:
    """Columns choose and order the degrees of freedom."""
    demo = demos.read_csv(table, columns=["y", "x"])
    np.testing.assert_array_equal(demo.position, POSITION[:, ::-1])


def test_csv_time_may_have_another_name(table: Path) -> None:
    """The time column is the one that is named, and t becomes a degree of freedom."""
    demo = demos.read_csv(table, time="y")
    np.testing.assert_array_equal(demo.time, POSITION[:, 1])
    assert list(demo.names) == ["t", "x"]


def test_dt_takes_the_place_of_time_stamps(table: Path) -> None:
    """With dt, the time column is neither needed nor a degree of freedom."""
    demo = demos.read_csv(table, dt=0.5)
    assert demo.dt == 0.5
    assert list(demo.names) == ["x", "y"]


def test_csv_bears_what_spreadsheets_write(tmp_path: Path) -> None:
    """A byte-order mark, spaces, blank lines and CRLF do not matter."""
    path = tmp_path / "demo.csv"
    path.write_bytes(b"\xef\xbb\xbf" + TABLE.replace(",", " , ").replace("\n", "\r\n\r\n").encode())
    np.testing.assert_array_equal(demos.read_csv(path).position, POSITION)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty"),
        ("0.0,1\n0.1,2\n", "line 1: '0.0' is not a name"),
        ("t,x,x\n", "two columns are called 'x'"),
        ("x,y\n1,2\n", "no column 't' with the time among x, y: .* pass dt="),
        (TABLE.replace("20", "2O"), "line 3, column 'y': '2O' is not a number"),
        (TABLE.replace("30", ""), "line 4, column 'y': '' is not a number"),
        (TABLE.replace("40", "nan"), "line 5, column 'y': nan is not finite"),
        (TABLE + "0.5,5\n", "line 6: 2 fields, expected 3"),
        ("t,x\n0,1\n0.1,2\n", "2 samples"),
        (TABLE.replace("0.2", "0.1"), "time"),
    ],
)
def test_bad_csv_is_refused_with_file_and_place(tmp_path: Path, text: str, message: str) -> None:
    """Whatever is wrong, the error is a ValueError that names the file and where to look."""
    path = tmp_path / "broken.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=rf"broken\.csv.*{message}"):
        demos.read_csv(path)


def test_csv_in_another_encoding_is_refused(tmp_path: Path) -> None:
    """Bytes that are not UTF-8 are named as such."""
    path = tmp_path / "latin.csv"
    path.write_bytes("t,höhe\n0,1\n".encode("latin-1"))
    with pytest.raises(ValueError, match=r"latin\.csv: not UTF-8"):
        demos.read_csv(path)


def test_missing_column_names_those_there_are(table: Path) -> None:
    """The error lists what could have been meant."""
    with pytest.raises(ValueError, match=r"no column 'z' among t, x, y"):
        demos.read_csv(table, columns=["z"])


def test_npz_gives_an_array_per_demonstration(tmp_path: Path) -> None:
    """Arrays are demonstrations under their own names, with their time stamps under NAME.t."""
    path = tmp_path / "demos.npz"
    np.savez(path, **{"a": POSITION, "a.t": TIME, "b": 2 * POSITION, "b.t": TIME})
    found = demos.read_npz(path)
    assert list(found) == ["a", "b"]
    np.testing.assert_array_equal(found["b"].position, 2 * POSITION)
    np.testing.assert_array_equal(found["b"].time, TIME)


def test_npz_gives_demonstrations_stored_one_after_another(tmp_path: Path) -> None:
    """The array start tells where each begins; names choose the columns."""
    path = tmp_path / "demos.npz"
    rows = np.concatenate([POSITION, POSITION + 1]).astype(np.float32)
    np.savez(path, y=rows, t=np.tile(TIME, 2), start=[0, 4, 8], names=["x", "y"])
    found = demos.read_npz(path, columns=["y"])
    assert list(found) == ["0", "1"]
    np.testing.assert_array_equal(found["1"].position, POSITION[:, 1:] + 1)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"a": POSITION}, "'a': no time stamps: pass dt="),
        ({"a": POSITION[0], "a.t": TIME}, r"'a': shape \(2,\), expected \(T, D\)"),
        ({"a": POSITION, "a.t": TIME, "names": ["x"]}, r"shape \(4, 2\), expected \(T, 1\)"),
        ({"y": POSITION, "t": TIME, "start": [0, 9]}, "'start' must rise from 0 to at most 4"),
        ({"a": np.array([[None]])}, "not an NPZ file of plain arrays"),
        ({"a": POSITION, "a.t": TIME[::-1]}, "'a': time"),
    ],
)
def test_bad_npz_is_refused(tmp_path: Path, arrays: dict[str, object], message: str) -> None:
    """Whatever is wrong, the error is a ValueError that names the file and the array."""
    path = tmp_path / "broken.npz"
    np.savez(path, **arrays)
    with pytest.raises(ValueError, match=rf"broken\.npz.*{message}"):
        demos.read_npz(path)


def test_a_file_that_is_no_npz_is_refused(tmp_path: Path) -> None:
    """Foreign bytes are not handed to any parser that could run them."""
    path = tmp_path / "broken.npz"
    path.write_bytes(b"PK\x03\x04 and nothing more")
    with pytest.raises(ValueError, match=r"broken\.npz: not an NPZ file"):
        demos.read_npz(path)


def test_folder_gives_demonstrations_by_id_with_their_context(folder: Path) -> None:
    """Columns of the index make the context."""
    found = demos.read_folder(folder, context=["height"])
    assert list(found) == ["a", "b"]
    np.testing.assert_array_equal(found["b"].context, [0.2])


def test_folder_may_hold_an_npz(folder: Path) -> None:
    """A demos.npz is read in the order of the index."""
    rows = np.concatenate([POSITION, POSITION + 1])
    np.savez(folder / "demos.npz", y=rows, t=np.tile(TIME, 2), start=[0, 4, 8])
    found = demos.read_folder(folder, context=["height"])
    np.testing.assert_array_equal(found["b"].position, POSITION + 1)
    np.testing.assert_array_equal(found["b"].context, [0.2])


def test_npz_and_index_must_agree(folder: Path) -> None:
    """A demonstration too many or too few is refused."""
    np.savez(folder / "demos.npz", y=POSITION, t=TIME, start=[0, 4])
    with pytest.raises(ValueError, match=r"holds 1 demonstrations, but index\.csv lists 2"):
        demos.read_folder(folder)


def test_context_may_be_labels(folder: Path) -> None:
    """A column of words makes labels."""
    found = demos.read_folder(folder, context=["shape", "height"])
    assert found["a"].context == ["C", 0.1]


def test_context_is_all_numbers_or_all_labels(folder: Path) -> None:
    """A word among numbers is refused with its place."""
    index = folder / "index.csv"
    index.write_text(index.read_text().replace("0.1", "low"))
    with pytest.raises(ValueError, match=r"index\.csv, line 2, column 'height': 'low' is not a n"):
        demos.read_folder(folder, context=["height"])


def test_id_must_be_unique(folder: Path) -> None:
    """Two rows of the index with the same id are refused."""
    (folder / "index.csv").write_text("id\na\na\n")
    with pytest.raises(ValueError, match=r"line 3: id 'a' appears twice"):
        demos.read_folder(folder)


def test_read_takes_files_and_folders_together(folder: Path) -> None:
    """Demonstrations come in the order of the paths."""
    single = folder / "demos" / "a.csv"
    assert len(demos.read([single, folder, single])) == 4


def test_read_refuses_what_it_does_not_know(tmp_path: Path) -> None:
    """Another suffix is refused with those that are read."""
    with pytest.raises(ValueError, match=r"expected a \.csv file, an \.npz file or a folder"):
        demos.read([tmp_path / "demo.txt"])


def test_context_needs_an_index(table: Path) -> None:
    """A context asked of a lone file is refused, not left out."""
    with pytest.raises(ValueError, match=r"index\.csv"):
        demos.read([table], context=["height"])


def test_missing_file_is_an_os_error(tmp_path: Path) -> None:
    """A file that is not there is no matter of its contents."""
    with pytest.raises(FileNotFoundError):
        demos.read([tmp_path / "none.csv"])


def test_written_csv_reads_back_to_the_last_bit(tmp_path: Path) -> None:
    """Positions and times survive a round trip unchanged."""
    model = pdmp.fit(reaches())
    trajectory = model.rollout()
    demos.write_csv(tmp_path / "out.csv", trajectory, model.names)
    demo = demos.read_csv(tmp_path / "out.csv", columns=model.names)
    np.testing.assert_array_equal(demo.position, trajectory.position)
    np.testing.assert_array_equal(demo.time, trajectory.time)


def test_interrupted_write_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C just before the end leaves what was there, and no draft beside it."""
    trajectory = pdmp.fit(reaches()).rollout()

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    path = tmp_path / "out.csv"
    path.write_text("before")
    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        demos.write_csv(path, trajectory, ["x", "y"])
    assert path.read_text() == "before"
    assert os.listdir(tmp_path) == ["out.csv"]


def test_each_dof_needs_a_name(tmp_path: Path) -> None:
    """A name too few is refused before anything is written."""
    with pytest.raises(ValueError, match="names has length 1, expected 2"):
        demos.write_csv(tmp_path / "out.csv", pdmp.fit(reaches()).rollout(), ["x"])
    assert os.listdir(tmp_path) == []
