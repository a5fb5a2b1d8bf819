"""Damaged recordings are refused in one line of this library, or read in finite numbers."""

import random
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest

import pdmp
import recorded
from recorded import JOINTS, TIME

N_CHANGES = 300  # of each format
MAX_SECONDS = 5.0  # for one file
POSITION = recorded.path_of(4)
Read = Callable[[], Any]


def bag(path: Path, kind: str, storage: str = "MCAP") -> tuple[Path, Read]:
    """Returns the file with the messages of a bag, and its reader."""
    folder = recorded.write_bag(path / "bag", kind, storage=storage)
    (file,) = [each for each in folder.iterdir() if each.suffix != ".yaml"]
    return file, lambda: pdmp.io.read_rosbag(file)


def metadata_of_a_bag(path: Path) -> tuple[Path, Read]:
    """Returns the description of a bag, and the reader of the bag."""
    folder = recorded.write_bag(path / "bag", "trajectory_msgs/msg/JointTrajectory")
    return folder / "metadata.yaml", lambda: pdmp.io.read_rosbag(folder)


def part_of_a_data_set(path: Path, version: str, part: str) -> tuple[Path, Read]:
    """Returns a file of a LeRobot data set, and the reader of the set."""
    folder = recorded.write_lerobot(path / "set", version, [POSITION] * 4)
    return folder / part, lambda: pdmp.io.read_lerobot(folder, context=["task"])


def parquet(path: Path) -> tuple[Path, Read]:
    """Returns a file of pandas and its reader."""
    pytest.importorskip("pyarrow")
    file = path / "frame.parquet"
    pandas.DataFrame(POSITION, columns=JOINTS, index=TIME).to_parquet(file)
    return file, lambda: pdmp.io.read_parquet(file)


def hdf5(path: Path) -> tuple[Path, Read]:
    """Returns a file of robomimic and its reader."""
    file = recorded.write_robomimic(path / "demo.hdf5", 1)
    return file, lambda: pdmp.io.read_hdf5(file)


FILES = {
    "joints in MCAP": lambda path: bag(path, "sensor_msgs/msg/JointState"),
    "poses in MCAP": lambda path: bag(path, "geometry_msgs/msg/PoseStamped"),
    "joints in SQLite": lambda path: bag(path, "sensor_msgs/msg/JointState", "SQLITE3"),
    "bag's metadata": metadata_of_a_bag,
    "frames of LeRobot": lambda path: part_of_a_data_set(
        path, "v3.0", "data/chunk-000/file-000.parquet"
    ),
    "episodes of LeRobot": lambda path: part_of_a_data_set(
        path, "v3.0", "meta/episodes/chunk-000/file-000.parquet"
    ),
    "description of LeRobot": lambda path: part_of_a_data_set(path, "v2.1", "meta/info.json"),
    "episodes of LeRobot 2": lambda path: part_of_a_data_set(path, "v2.1", "meta/episodes.jsonl"),
    "Parquet": parquet,
    "HDF5": hdf5,
}


def changed(data: bytes, rng: random.Random) -> bytes:
    """Returns a file that was cut, extended or changed in a few bytes."""
    share, place = rng.random(), rng.randrange(len(data))
    if share < 0.3:
        return data[:place]
    if share < 0.4:
        return data[:place] + rng.randbytes(rng.choice([1, 4, 100])) + data[place:]
    damaged = bytearray(data)
    for _ in range(rng.choice([1, 1, 4, 20])):
        place = rng.randrange(len(data))
        damaged[place] = rng.choice([damaged[place] ^ 1 << rng.randrange(8), 255, 0])
    return bytes(damaged)


@pytest.mark.parametrize("make", FILES.values(), ids=FILES)
def test_a_damaged_file_is_refused_in_one_line_or_read_in_finite_numbers(
    tmp_path: Path, make: Callable[[Path], tuple[Path, Read]]
) -> None:
    """No error of another library reaches the caller; each refusal names the file or data set."""
    file, read = make(tmp_path)
    data, rng, n_refused = file.read_bytes(), random.Random(file.name), 0
    assert read()
    for _ in range(N_CHANGES):
        file.write_bytes(changed(data, rng))
        start = time.monotonic()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = read()
        except (ValueError, OSError) as error:
            n_refused += 1
            assert type(error) is ValueError or isinstance(error, OSError)
            assert str(tmp_path) in str(error) and "\n" not in str(error)
        else:
            for demo in found.values() if isinstance(found, dict) else [found]:
                assert np.isfinite(demo.position).all()
        assert time.monotonic() - start < MAX_SECONDS
    assert n_refused > N_CHANGES // 5


@pytest.mark.parametrize("make", FILES.values(), ids=FILES)
def test_an_empty_file_is_refused(
    tmp_path: Path, make: Callable[[Path], tuple[Path, Read]]
) -> None:
    """A file of no bytes is refused like any other."""
    file, read = make(tmp_path)
    file.write_bytes(b"")
    with pytest.raises(ValueError, match=str(tmp_path)):
        read()
