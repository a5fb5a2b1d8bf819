"""Reader of LeRobot data sets, and writer of movements as episodes of one."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmp._labels import name_list
from pdmp._messages import value_error
from pdmp._native import Demonstration
from pdmp.io import _lerobot_meta as meta
from pdmp.io._collections import NamedDemonstrations
from pdmp.io._demonstration import Options, select
from pdmp.io._features import feature_list, unique_names
from pdmp.io._packages import ContentError, load, reading

FILES = "LeRobot data sets"


def read_lerobot(
    path: str | PathLike[str],
    *,
    features: str | Sequence[str] = "observation.state",
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
    path = Path(path)
    listed = feature_list(features)
    options = Options(columns, dt, max_gap)
    wanted = name_list("context", context or [])
    info = meta.read_info(path)
    names = unique_names({each: meta.element_names(path, info, each) for each in listed})
    lengths, tasks = meta.read_episodes(path)
    kept = sorted(lengths) if episodes is None else [int(each) for each in episodes]
    if missing := [each for each in kept if each not in lengths]:
        raise value_error(f"{path}: no episode {missing[0]} among {len(lengths)}")
    others = [name for name in wanted if name != "task"]
    for name in others:
        meta.element_names(path, info, name)
    frames = _frames(path, [*listed, *others], set(kept))
    demos = NamedDemonstrations(context_names=wanted)
    for episode in kept:
        source = f"{path}, episode {episode}"
        rows = frames.get(episode)
        n_rows = 0 if rows is None else len(rows["timestamp"])
        if rows is None or n_rows != lengths[episode]:
            raise value_error(
                f"{source}: has {n_rows} frames, but its metadata state {lengths[episode]}"
            )
        position, time = np.hstack([rows[each] for each in listed]), rows["timestamp"]
        if position.shape[1] != len(names):
            raise value_error(
                f"{source}: {position.shape[1]} positions, but meta/info.json states {len(names)}"
            )
        interval = meta.interval(time, info)
        values: list[float | str] = []
        for name in wanted:
            values += [tasks[episode]] if name == "task" else rows[name][0].tolist()
        demos[str(episode)] = select(
            source,
            options,
            position,
            names,
            [""] * len(names),
            dt=interval,
            time=time if interval is None else None,
            context=values or None,
        )
    return demos


def _frames(
    path: Path, features: Sequence[str], episodes: set[int]
) -> dict[int, dict[str, NDArray[np.float64]]]:
    """Returns features and time stamps of the frames of each episode, in the order of frames."""
    parquet = load("pyarrow.parquet", "lerobot", FILES)
    files = sorted((path / "data").glob("*/*.parquet"))
    if not files:
        raise value_error(f"{path}: no files data/*/*.parquet")
    columns = list(dict.fromkeys(["episode_index", "frame_index", "timestamp", *features]))
    parts: dict[int, list[dict[str, Any]]] = {}
    for file in files:
        with reading(file, "Parquet"):
            table = parquet.ParquetFile(file)
            absent = [name for name in columns if name not in table.schema_arrow.names]
            if absent:
                raise ContentError(f"no column '{absent[0]}'")
            table = table.read(columns=columns)
            arrays = {name: meta.matrix(table.column(name)) for name in columns}
        index = arrays["episode_index"][:, 0]
        for episode in episodes.intersection(index.tolist()):
            rows = index == episode
            parts.setdefault(episode, []).append({name: a[rows] for name, a in arrays.items()})
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
