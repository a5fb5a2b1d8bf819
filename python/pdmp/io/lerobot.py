"""Reader of LeRobot data sets, and writer of movements as episodes of one."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmp._files import file_path
from pdmp._labels import name_list
from pdmp._messages import value_error
from pdmp._native import Demonstration
from pdmp.io import _lerobot_meta as meta
from pdmp.io._collections import NamedDemonstrations
from pdmp.io._demonstration import Options, select
from pdmp.io._features import feature_list, unique_names
from pdmp.io._fields import column_indices
from pdmp.io._packages import ContentError, load, reading

FILES = "LeRobot data sets"
STATE = "observation.state"


def read_lerobot(
    path: str | PathLike[str],
    *,
    features: str | Sequence[str] = STATE,
    episodes: Sequence[int] | None = None,
    columns: Sequence[str] | None = None,
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[str] | None = None,
) -> dict[str, Demonstration]:
    """Reads the episodes of a LeRobot data set, by their index; needs the extra `lerobot`.

    Folders of the versions 3.0 and 2.1 are read, without videos. The degrees of freedom have the
    names of the elements of the features, without units, which the format does not state.

    Parameters
    ----------
    path : path
        Folder of the data set, with `meta/info.json` and `data`.
    features : str or sequence of str
        Features with the positions, such as "observation.state" or "action".
    episodes : sequence of int, optional
        Indices of the episodes to read; all by default.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all by default.
    dt : float, optional
        Sampling interval [s], instead of the time stamps of the frames.
    max_gap : float
        Longest gap [s], of NaN or null, to interpolate; by default 0, none.
    context : sequence of str, optional
        What forms the context (Q,) of each episode: "task", the text of its first task, or
        features, by their values in the first frame.

    Raises
    ------
    ImportError
        The package pyarrow is not installed.
    ValueError
        A folder that is not a data set of these versions, a missing feature, episode or column, an
        episode with fewer frames than its metadata state, or data that `Demonstration` rejects.
    OSError
        A file that cannot be read.

    See Also
    --------
    write_lerobot : Writes movements as episodes.
    """
    data_set = open_lerobot(path, features, Options(columns, dt, max_gap), context or [])
    kept = data_set.episodes if episodes is None else [int(each) for each in episodes]
    if missing := [each for each in kept if each not in data_set.episodes]:
        raise value_error(f"{path}: no episode {missing[0]} among {len(data_set.episodes)}")
    return data_set.part(kept).read()


@dataclass(frozen=True)
class Episodes:
    """Episodes of a data set with their metadata, which another process can read."""

    path: Path
    features: list[str]
    context: list[str]
    names: list[str]
    fps: Any
    options: Options
    episodes: dict[int, meta.Episode]

    def part(self, indices: Iterable[int]) -> Episodes:
        """Returns some of the episodes."""
        return replace(self, episodes={index: self.episodes[index] for index in indices})

    def read(self) -> NamedDemonstrations:
        """Returns the demonstrations by the indices of their episodes."""
        columns = [*self.features, *(name for name in self.context if name != "task")]
        files = sorted({each.file for each in self.episodes.values() if each.file is not None})
        frames = _frames(self.path, files, columns, self.episodes)
        # Frames that are not where the metadata state are searched for in all files.
        astray = [
            index
            for index, episode in self.episodes.items()
            if index not in frames or len(frames[index]["timestamp"]) != episode.n_frames
        ]
        if astray:
            frames |= _frames(self.path, _data_files(self.path), columns, astray)
        demos = NamedDemonstrations(context_names=self.context)
        for index, episode in self.episodes.items():
            demos[str(index)] = self._demonstration(index, episode, frames.get(index))
        return demos

    def _demonstration(
        self, index: int, episode: meta.Episode, rows: dict[str, NDArray[np.float64]] | None
    ) -> Demonstration:
        source = f"{self.path}, episode {index}"
        n_rows = 0 if rows is None else len(rows["timestamp"])
        if rows is None or n_rows != episode.n_frames:
            raise value_error(
                f"{source}: has {n_rows} frames, but its metadata state {episode.n_frames}"
            )
        position, time = np.hstack([rows[each] for each in self.features]), rows["timestamp"]
        if position.shape[1] != len(self.names):
            raise value_error(
                f"{source}: {position.shape[1]} positions, but meta/info.json states "
                f"{len(self.names)}"
            )
        interval = meta.interval(time, self.fps)
        values: list[float | str] = []
        for name in self.context:
            values += [episode.task] if name == "task" else rows[name][0].tolist()
        return select(
            source,
            self.options,
            position,
            self.names,
            [""] * len(self.names),
            dt=interval,
            time=time if interval is None else None,
            context=values or None,
        )


def open_lerobot(
    path: str | PathLike[str],
    features: str | Sequence[str],
    options: Options,
    context: Sequence[str],
) -> Episodes:
    """Reads the metadata of a data set."""
    path = file_path(path)
    listed = feature_list(features)
    wanted = name_list("context", context)
    info = meta.read_info(path)
    names = unique_names({each: meta.element_names(path, info, each) for each in listed})
    if options.columns is not None:
        column_indices(path, names, name_list("columns", options.columns))
    for name in wanted:
        if name != "task":
            meta.element_names(path, info, name)
    files = _data_files(path)
    episodes = meta.read_episodes(path, files)
    if not files:
        raise value_error(f"{path}: no files data/*/*.parquet")
    return Episodes(path, listed, wanted, names, info.get("fps"), options, episodes)


def _data_files(path: Path) -> list[Path]:
    return sorted((path / "data").glob("*/*.parquet"))


def _frames(
    path: Path, files: Sequence[Path], features: Sequence[str], episodes: Collection[int]
) -> dict[int, dict[str, NDArray[np.float64]]]:
    """Returns features and time stamps of the frames of each episode, in the order of frames."""
    parquet = load("pyarrow.parquet", "lerobot", FILES)
    columns = list(dict.fromkeys(["episode_index", "frame_index", "timestamp", *features]))
    wanted = sorted(episodes)
    parts: dict[int, list[dict[str, Any]]] = {}
    for file in files:
        file.stat()  # a missing file is an error of the system
        with reading(file, "Parquet"):
            table = parquet.ParquetFile(file)
            absent = [name for name in columns if name not in table.schema_arrow.names]
            if absent:
                raise ContentError(f"no column '{absent[0]}'")
            table = table.read_row_groups(_row_groups(table, wanted), columns=columns)
            arrays = {name: meta.matrix(table.column(name)) for name in columns}
        index = arrays["episode_index"][:, 0]
        order = np.argsort(index, kind="stable")
        present, begins = np.unique(index[order], return_index=True)
        for episode, rows in zip(present.tolist(), np.split(order, begins[1:]), strict=False):
            if episode in episodes:
                part = {name: array[rows] for name, array in arrays.items()}
                parts.setdefault(int(episode), []).append(part)
    frames = {}
    for episode, found in parts.items():
        try:
            joined = {name: np.concatenate([part[name] for part in found]) for name in columns}
        except ValueError:
            raise value_error(f"{path}, episode {episode}: frames of different shapes") from None
        order = np.argsort(joined["frame_index"][:, 0], kind="stable")
        frames[episode] = {name: array[order] for name, array in joined.items()}
        frames[episode]["timestamp"] = frames[episode]["timestamp"][:, 0]
    return frames


def _row_groups(table: Any, episodes: Sequence[int]) -> list[int]:
    """Returns the row groups of a file whose statistics allow for some of the sorted episodes."""
    paths = [table.schema.column(k).path for k in range(len(table.schema))]
    if "episode_index" not in paths:
        return list(range(table.num_row_groups))
    column, found = paths.index("episode_index"), []
    for group in range(table.num_row_groups):
        statistics = table.metadata.row_group(group).column(column).statistics
        if statistics is not None and statistics.has_min_max:
            first = bisect_left(episodes, statistics.min)
            if first == len(episodes) or episodes[first] > statistics.max:
                continue
        found.append(group)
    return found
