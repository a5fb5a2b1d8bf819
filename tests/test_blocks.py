"""Blocks of recordings are those of the reader of all, and are read from their own files alone."""

import json
import pickle
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pdmp
import recorded
from pdmp.io._blocks import Blocks
from recorded import JOINTS, RATE, TIME

VERSIONS = pytest.mark.parametrize("version", ["v3.0", "v2.1"])
N_EPISODES = 12


@pytest.fixture
def data_set(tmp_path: Path, version: str) -> Path:
    """Returns a LeRobot data set."""
    paths = [recorded.path_of(k, n_samples=160 + k) for k in range(N_EPISODES)]
    return recorded.write_lerobot(tmp_path / "set", version, paths)


def assert_equal(blocks: Blocks, whole: Sequence[pdmp.Demonstration]) -> None:
    """Asserts that the blocks, in another process too, have all demonstrations in their order."""
    for own in (blocks, pickle.loads(pickle.dumps(blocks))):
        found = [demo for read in own for demo in read()]
        assert len(found) == len(whole)
        for demo, other in zip(found, whole, strict=True):
            np.testing.assert_array_equal(demo.position, other.position)
            assert (demo.names, demo.dt, demo.units) == (other.names, other.dt, other.units)
            assert (demo.context is None) == (other.context is None)
            assert demo.context is None or list(demo.context) == list(other.context)


@VERSIONS
def test_blocks_of_episodes_are_those_of_the_data_set(data_set: Path) -> None:
    """Options, order and the last, shorter block are as for the reader; so is the model."""
    options = {"context": ["observation.load"], "columns": ["wrist", "elbow"]}
    blocks = pdmp.io.read_blocks(data_set, size=5, features="action", **options)
    assert [len(block) for block in blocks()] == [5, 5, 2]
    whole = pdmp.io.read_lerobot(data_set, features="action", **options)
    assert_equal(blocks, list(whole.values()))
    assert_equal(pdmp.io.read_blocks([data_set, data_set]), pdmp.io.read([data_set] * 2))
    model, other = pdmp.fit(blocks), pdmp.fit(list(whole.values()))
    np.testing.assert_allclose(model.styles, other.styles, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(model.contexts, other.contexts)


@VERSIONS
def test_a_block_opens_its_own_files_alone(data_set: Path) -> None:
    """Metadata are read once, and the files of other blocks are not opened."""
    whole = list(pdmp.io.read_lerobot(data_set).values())
    blocks = pdmp.io.read_blocks(data_set, size=6)
    files = sorted((data_set / "data").glob("*/*.parquet"))
    shutil.rmtree(data_set / "meta")
    for file in files[: len(files) // 2]:
        file.unlink()
    assert_equal(blocks[1:], whole[6:])
    with pytest.raises(FileNotFoundError, match=files[0].name):
        blocks[0]()


def test_a_block_reads_the_row_groups_of_its_episodes(tmp_path: Path) -> None:
    """Row groups of other episodes are not read, whether or not the file of an episode is known."""
    parquet = pytest.importorskip("pyarrow.parquet")
    paths = [recorded.path_of(k) for k in range(8)]
    folder = recorded.write_lerobot(tmp_path / "set", "v3.0", paths)
    whole = list(pdmp.io.read_lerobot(folder).values())
    file = folder / "data" / "chunk-000" / "file-000.parquet"
    parquet.write_table(parquet.read_table(file), file, row_group_size=len(TIME))
    group = parquet.ParquetFile(file).metadata.row_group(1)
    begin = group.column(0).data_page_offset
    data = bytearray(file.read_bytes())
    data[begin : begin + 100] = bytes(100)
    file.write_bytes(data)
    (episodes,) = (folder / "meta" / "episodes").glob("*/*.parquet")
    table = parquet.read_table(episodes)
    for names in (table.column_names, ["episode_index", "length", "tasks"]):
        parquet.write_table(table.select(names), episodes)
        blocks = pdmp.io.read_blocks(folder, size=1)
        assert_equal(blocks[:1], whole[:1])
        assert_equal(blocks[2:], whole[2:])
        with pytest.raises(ValueError, match="file-000.parquet: not a Parquet file, or damaged"):
            blocks[1]()


def test_frames_are_found_in_files_that_the_metadata_do_not_state(tmp_path: Path) -> None:
    """Files of other names, and of names that others should have, are searched for episodes."""
    paths = [recorded.path_of(k) for k in range(4)]
    folder = recorded.write_lerobot(tmp_path / "set", "v3.0", paths)
    whole = list(pdmp.io.read_lerobot(folder).values())
    data = folder / "data" / "chunk-000"
    contents = [(data / name).read_bytes() for name in ("file-000.parquet", "file-001.parquet")]
    for names in (["part", "file-000"], ["file-001", "part"], ["file-001", "file-000"]):
        for file in data.iterdir():
            file.unlink()
        for name, content in zip(names, contents, strict=True):
            (data / f"{name}.parquet").write_bytes(content)
        assert_equal(pdmp.io.read_blocks(folder, size=1), whole)


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz"])
@pytest.mark.parametrize("place", [".", "demos"])
def test_blocks_of_files_are_those_of_the_folder(tmp_path: Path, suffix: str, place: str) -> None:
    """A folder of tables or arrays is read in natural order, a block from its own files."""
    folder = tmp_path / place
    folder.mkdir(exist_ok=True)
    for k in range(11):
        write_table(folder / f"take {k}{suffix}", recorded.path_of(k))
    whole = pdmp.io.read_folder(tmp_path, columns=["wrist", "elbow"])
    assert list(whole) == [f"take {k}" for k in range(11)]
    blocks = pdmp.io.read_blocks(tmp_path, size=4, columns=["wrist", "elbow"])
    assert [len(block) for block in blocks()] == [4, 4, 3]
    assert_equal(blocks, list(whole.values()))
    for k in range(4):
        (folder / f"take {k}{suffix}").unlink()
    assert_equal(blocks[1:], list(whole.values())[4:])
    with pytest.raises(
        ValueError, match=f"take 4{suffix}.*no column 'knee' among .*shoulder, elbow"
    ):
        pdmp.io.read_blocks(tmp_path, columns=["knee"])[0]()


def write_table(path: Path, position: np.ndarray) -> None:
    """Writes a demonstration."""
    if path.suffix == ".npz":
        np.savez(path, position=position, time=TIME, names=JOINTS)
    elif path.suffix == ".csv":
        table = np.column_stack([TIME, position])
        np.savetxt(path, table, delimiter=",", header=f"t,{','.join(JOINTS)}", comments="")
    else:
        arrow = pytest.importorskip("pyarrow")
        columns = dict(zip(["t", *JOINTS], [TIME, *position.T], strict=True))
        pytest.importorskip("pyarrow.parquet").write_table(arrow.table(columns), path)


def test_contexts_of_an_index_are_read_once(tmp_path: Path) -> None:
    """Files are in the order of the index, with its numbers and labels."""
    (tmp_path / "demos").mkdir()
    for name in "abc":
        write_table(tmp_path / "demos" / f"{name}.csv", recorded.path_of(ord(name)))
    index = tmp_path / "index.csv"
    index.write_text("id,height,hand\nc,0.3,left\na,0.1,right\nb,0.2,left\n")
    whole = pdmp.io.read(tmp_path, context=["height", "hand"])
    blocks = pdmp.io.read_blocks(tmp_path, size=2, context=["height", "hand"])
    index.unlink()
    assert_equal(blocks, whole)
    assert blocks[0]()[0].context == [0.3, "left"]


def test_a_file_of_several_demonstrations_is_a_block(tmp_path: Path) -> None:
    """Files of several demonstrations are blocks by default, and counted by `size`."""
    for k in range(3):
        stack = np.array([recorded.path_of(10 * k + m) for m in range(2 + k)])
        np.savez(tmp_path / f"part{k}.npz", position=stack, time=TIME)
    single = tmp_path / "one.csv"
    write_table(single, recorded.path_of(99))
    paths = sorted(tmp_path.glob("*.npz"))
    whole = pdmp.io.read([*paths, single, single])
    for size, counts in ((None, [2, 3, 4, 2]), (2, [5, 5, 1]), (9, [11])):
        blocks = pdmp.io.read_blocks([*paths, single, single], size=size)
        assert [len(block) for block in blocks()] == counts
        assert_equal(blocks, whole)
    single.unlink()
    names = ["part0/0", "part0/1", "part1/0", "part1/1", "part1/2"]
    assert list(pdmp.io.read_folder(tmp_path))[:5] == names
    assert_equal(pdmp.io.read_blocks(tmp_path), whole[:-2])
    np.savez(tmp_path / "demos.npz", position=stack, time=TIME)
    (tmp_path / "index.csv").write_text("id,x\n" + "".join(f"{k},{k}\n" for k in range(4)))
    assert_equal(
        pdmp.io.read_blocks(tmp_path, context=["x"]), pdmp.io.read(tmp_path, context=["x"])
    )


def test_demonstrations_of_robomimic_are_blocks_of_their_file(tmp_path: Path) -> None:
    """Features and contexts of HDF5 files are those of their reader."""
    path = recorded.write_robomimic(tmp_path / "demo.hdf5")
    options = {"features": "obs/robot0_joint_pos", "context": ["object"]}
    whole = pdmp.io.read_hdf5(path, **options)
    assert_equal(pdmp.io.read_blocks([path, path], **options), [*whole.values()] * 2)


def test_relative_paths_are_those_of_the_caller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker in another folder finds the files."""
    write_table(tmp_path / "a.csv", recorded.path_of(0))
    monkeypatch.chdir(tmp_path)
    blocks, whole = pdmp.io.read_blocks("."), pdmp.io.read(".")
    (tmp_path / "other").mkdir()
    monkeypatch.chdir("other")
    assert_equal(blocks, whole)


@pytest.mark.parametrize("version", ["v3.0"])
def test_bad_sources_are_refused_before_a_block_is_read(tmp_path: Path, data_set: Path) -> None:
    """Sizes, folders, columns and features that cannot be are named at once."""
    read = pdmp.io.read_blocks
    for size in (0, -3):
        with pytest.raises(ValueError, match=f"size = {size}: must be at least 1"):
            read(data_set, size=size)
    for size in (2.5, "all"):
        with pytest.raises(TypeError, match="size = .*: expected a whole number"):
            read(data_set, size=size)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="paths is empty: pass at least one file or folder"):
        read([])
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match=r"empty: no index\.csv, and no files: expected"):
        read(tmp_path / "empty")
    with pytest.raises(FileNotFoundError, match="No such file or directory: .*none"):
        read(tmp_path / "none")
    (tmp_path / "some.doc").touch()
    with pytest.raises(ValueError, match=r"some\.doc: expected a folder or a file of one of \.csv"):
        read(tmp_path / "some.doc")
    with pytest.raises(ValueError, match="set: no column 'knee' among shoulder, elbow, wrist"):
        read(data_set, columns=["knee"])
    with pytest.raises(ValueError, match="set: no feature 'x' of numbers"):
        read(data_set, features="x")
    with pytest.raises(ValueError, match=r"a\.csv: features are those of LeRobot .*: pass columns"):
        read(tmp_path / "a.csv", features="x")
    with pytest.raises(ValueError, match=r"a\.csv: a context is read from the index\.csv"):
        read(tmp_path / "a.csv", context=["height"])
    with pytest.raises(ValueError, match="columns = 'wrist': pass a list of names"):
        read(data_set, columns="wrist")
    info = data_set / "meta" / "info.json"
    info.write_text(json.dumps(json.loads(info.read_text()) | {"fps": RATE / 2}))
    assert read(data_set)[0]()[0].dt is None


def test_blocks_are_a_sequence(tmp_path: Path) -> None:
    """Blocks have a length, slices that are blocks, and a repr."""
    write_table(tmp_path / "a.csv", recorded.path_of(0))
    blocks = pdmp.io.read_blocks([tmp_path / "a.csv"] * 5, size=2)
    assert len(blocks) == 3 and repr(blocks) == "Blocks(n_blocks=3)"
    assert repr(blocks[1:]) == "Blocks(n_blocks=2)"
    assert len(blocks[-1]()) == 1


@VERSIONS
def test_a_cluster_reads_the_episodes_of_a_folder(data_set: Path, client: Any) -> None:
    """Two workers, each of which reads its own episodes, fit the model of one process."""
    blocks = pdmp.io.read_blocks(data_set, size=3, context=["observation.load"])
    model = pdmp.fit_distributed(blocks, client=client, n_samples=160)
    whole = pdmp.io.read_lerobot(data_set, context=["observation.load"])
    other = pdmp.fit(list(whole.values()), n_samples=160)
    np.testing.assert_allclose(model.styles, other.styles, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(model.goals, other.goals)
    np.testing.assert_array_equal(model.contexts, other.contexts)
    own = [fit.rollout(fit.conditions(7)).position for fit in (model, other)]
    np.testing.assert_allclose(*own, rtol=0, atol=1e-10)
