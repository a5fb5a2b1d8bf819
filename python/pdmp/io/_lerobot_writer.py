"""Writer of movements as episodes of a LeRobot data set of version 3.0."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmp._files import file_path, new_folder
from pdmp._labels import name_list
from pdmp._messages import check_type, value_error
from pdmp._native import Demonstration, Trajectory
from pdmp.io._packages import load

FILES = "LeRobot data sets"
MAX_RATE_ERROR = 1e-6
"""Largest relative difference of an interval to that of a whole number of frames per second."""
FRAME = "chunk-{chunk_index:03d}/file-{file_index:03d}"
INDICES = ("frame_index", "episode_index", "index", "task_index")
Movement = Trajectory | Demonstration


def write_lerobot(
    path: str | PathLike[str],
    movements: Sequence[Movement] | Mapping[str, Movement],
    *,
    tasks: str | Sequence[str],
    robot: str = "unknown",
) -> None:
    """Writes movements as episodes of a LeRobot data set, version 3.0; needs the extra `lerobot`.

    The feature "observation.state" has the positions of each sample and "action" those of the next
    one, of the last sample its own, both in single precision. The sampling interval of the
    movements determines the frames per second. `read_lerobot` reads the data set back.

    Parameters
    ----------
    path : path
        Folder to write, which must not exist.
    movements : sequence or mapping of Trajectory or Demonstration
        Movements of the same degrees of freedom and interval, such as `model.rollout(dt=1 / 30)`.
    tasks : str or sequence of str
        Description of the task, of all movements or of each.
    robot : str
        Type of the robot.

    Raises
    ------
    ImportError
        The package pyarrow is not installed.
    ValueError
        No movements, different names or intervals, an interval that is not that of a whole number
        of frames per second, or a number of tasks other than that of the movements.
    OSError
        A folder that exists, or that cannot be written.

    See Also
    --------
    read_lerobot : Reads the episodes of a data set.
    """
    path = file_path(path)
    listed = list(movements.values() if isinstance(movements, Mapping) else movements)
    texts = [tasks] * len(listed) if isinstance(tasks, str) else name_list("tasks", tasks)
    check_type("robot", robot, str, "the type of a robot")
    if not listed:
        raise ValueError("movements is empty: pass at least one")
    if len(texts) != len(listed):
        raise value_error(
            f"tasks has length {len(texts)}, expected {len(listed)}: one per movement"
        )
    for k, each in enumerate(listed):
        check_type(f"movements[{k}]", each, (Trajectory, Demonstration), "a Trajectory")
    names = _names(listed)
    fps = _frames_per_second(listed)
    load("pyarrow.parquet", "lerobot", FILES)
    episodes = [_episode(k, each, texts, fps) for k, each in enumerate(listed)]
    begins = np.cumsum([0, *(len(each["timestamp"]) for each in episodes)]).tolist()
    for begin, episode in zip(begins, episodes, strict=False):
        episode["index"] = begin + episode["frame_index"]
    frames = {name: np.concatenate([each[name] for each in episodes]) for name in episodes[0]}
    labels = list(dict.fromkeys(texts))
    info = {
        "codebase_version": "v3.0",
        "robot_type": robot,
        "total_episodes": len(listed),
        "total_frames": begins[-1],
        "total_tasks": len(labels),
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 500,
        "fps": fps,
        "splits": {"train": f"0:{len(listed)}"},
        "data_path": f"data/{FRAME}.parquet",
        "video_path": None,
        "features": _features(names, fps),
    }
    rows = [
        {
            "episode_index": k,
            "tasks": [texts[k]],
            "length": begins[k + 1] - begins[k],
            "data/chunk_index": 0,
            "data/file_index": 0,
            "dataset_from_index": begins[k],
            "dataset_to_index": begins[k + 1],
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
        }
        | {
            f"stats/{name}/{kind}": value
            for name, own in _statistics(episode).items()
            for kind, value in own.items()
        }
        for k, episode in enumerate(episodes)
    ]
    with new_folder(path) as draft:
        folder = draft / path.name
        (folder / "meta").mkdir(parents=True)
        _write_json(folder / "meta" / "info.json", info)
        _write_json(folder / "meta" / "stats.json", _statistics(frames))
        _write_tables(folder, frames, rows, labels)


def _names(movements: Sequence[Movement]) -> list[str]:
    """Returns the names of the coordinates, equal for all movements."""
    widths = {each.position.shape[1] for each in movements}
    names = {tuple(each.names or []) for each in movements}
    if len(widths) > 1 or len(names) > 1:
        raise ValueError("movements have different degrees of freedom")
    return list(names.pop()) or [f"y{d}" for d in range(widths.pop())]


def _frames_per_second(movements: Iterable[Movement]) -> int:
    """Returns the whole number of frames per second that all movements have."""
    rates = set()
    for k, each in enumerate(movements):
        if each.time is None:
            raise value_error(f"movements[{k}] has no times: make it with dt=")
        steps = np.diff(each.time)
        interval = float((each.time[-1] - each.time[0]) / max(len(steps), 1))
        fps = round(1 / interval) if interval > 0 else 0
        if fps < 1 or np.abs(steps * fps - 1).max() > MAX_RATE_ERROR:
            raise value_error(
                f"movements[{k}] has intervals of {steps.min():g} to {steps.max():g} s: expected "
                "those of a whole number of frames per second, as from rollout(dt=1 / 30)"
            )
        rates.add(fps)
    if len(rates) > 1:
        raise value_error(f"movements have {min(rates)} and {max(rates)} frames per second")
    return int(rates.pop())


def _episode(k: int, movement: Movement, texts: list[str], fps: int) -> dict[str, NDArray[Any]]:
    """Returns the columns of the frames of an episode, other than the index in the data set."""
    position = movement.position.astype("f4")
    frames = np.arange(len(position))
    return {
        "observation.state": position,
        "action": np.vstack([position[1:], position[-1:]]),
        "timestamp": (frames / fps).astype("f4"),
        "frame_index": frames,
        "episode_index": np.full(len(frames), k),
        "task_index": np.full(len(frames), list(dict.fromkeys(texts)).index(texts[k])),
    }


def _features(names: list[str], fps: int) -> dict[str, Any]:
    """Returns the descriptions of the columns."""
    vectors = {
        name: {"dtype": "float32", "shape": [len(names)], "names": names, "fps": fps}
        for name in ("observation.state", "action")
    }
    scalars = {"timestamp": "float32"} | dict.fromkeys(INDICES, "int64")
    return vectors | {
        name: {"dtype": dtype, "shape": [1], "names": None} for name, dtype in scalars.items()
    }


def _statistics(frames: Mapping[str, NDArray[Any]]) -> dict[str, dict[str, list[float]]]:
    """Returns minimum, maximum, mean, standard deviation and count of each column."""
    columns = {name: each.astype(float).reshape(len(each), -1) for name, each in frames.items()}
    return {
        name: {
            "min": each.min(0).tolist(),
            "max": each.max(0).tolist(),
            "mean": each.mean(0).tolist(),
            "std": each.std(0).tolist(),
            "count": [len(each)],
        }
        for name, each in columns.items()
    }


def _write_json(path: Path, content: Any) -> None:
    path.write_text(json.dumps(content, indent=4, ensure_ascii=False), encoding="utf-8")


def _write_tables(
    folder: Path, frames: Mapping[str, NDArray[Any]], rows: list[dict[str, Any]], labels: list[str]
) -> None:
    """Writes frames, episodes and tasks as Parquet."""
    arrow, parquet = load("pyarrow", "lerobot", FILES), load("pyarrow.parquet", "lerobot", FILES)
    file = FRAME.format(chunk_index=0, file_index=0)
    arrays = {
        name: arrow.array(each)
        if each.ndim == 1
        else arrow.FixedSizeListArray.from_arrays(each.ravel(), each.shape[1])
        for name, each in frames.items()
    }
    tables = {
        f"data/{file}": arrow.table(arrays),
        f"meta/episodes/{file}": arrow.Table.from_pylist(rows),
    }
    # The names of the tasks are the index that pandas reads.
    index = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [
            {"name": "task_index", "field_name": "task_index", "pandas_type": "int64",
             "numpy_type": "int64", "metadata": None},
            {"name": "task", "field_name": "task", "pandas_type": "unicode",
             "numpy_type": "object", "metadata": None},
        ],
        "pandas_version": "2.0.0",
    }  # fmt: skip
    tasks = arrow.table({"task_index": np.arange(len(labels)), "task": labels})
    tables["meta/tasks"] = tasks.replace_schema_metadata({"pandas": json.dumps(index)})
    for name, table in tables.items():
        path = folder / f"{name.removesuffix('.parquet')}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        parquet.write_table(table, path)
