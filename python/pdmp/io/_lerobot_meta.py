"""Metadata of LeRobot data sets of the versions 3.0 and 2.1."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmp._messages import value_error
from pdmp.io._features import numbered
from pdmp.io._packages import load, reading

VERSIONS = ("v3.0", "v2.1", "v2.0")
MAX_ELEMENTS = 100_000
"""Largest number of elements of a feature with positions; images have more."""
PLACE = ("data/chunk_index", "data/file_index")
"""Columns with the numbers in the name of the data file of an episode, in version 3.0."""


class Episode(NamedTuple):
    """Number of frames, text of the first task, and file of the frames, None if unknown."""

    n_frames: int
    task: str
    file: Path | None


def read_info(path: Path) -> dict[str, Any]:
    """Returns the description of a data set."""
    file = path / "meta" / "info.json"
    if path.is_dir() and not file.exists():
        raise value_error(f"{path}: not a LeRobot data set: it has no meta/info.json")
    info = _json(file, file.read_bytes())
    version = info.get("codebase_version") if isinstance(info, dict) else None
    if version not in VERSIONS:
        raise value_error(
            f"{file}: codebase_version is '{version}': expected {' or '.join(VERSIONS[:2])}; "
            "convert the data set with lerobot"
        )
    if not isinstance(info.get("features"), dict):
        raise value_error(f"{file}: no features")
    return info  # type: ignore[no-any-return]


def element_names(path: Path, info: dict[str, Any], feature: str) -> list[str]:
    """Returns the names of the elements of a numeric vector."""
    features = info["features"]
    vectors = [name for name in features if _is_vector(features[name])]
    if feature not in vectors:
        raise value_error(f"{path}: no feature '{feature}' of numbers among {', '.join(vectors)}")
    n_elements = int(features[feature]["shape"][0])
    names: Any = features[feature].get("names")
    if isinstance(names, dict):
        # Names of several motors under one key, or a number for each name.
        lists = [value for value in names.values() if isinstance(value, list)]
        names = list(chain(*lists)) if lists else list(names)
    if isinstance(names, list) and len(names) == len(set(map(str, names))) == n_elements:
        return list(map(str, names))
    return numbered(feature.rpartition(".")[2], n_elements)


def _is_vector(feature: Any) -> bool:
    if not isinstance(feature, dict) or not isinstance(feature.get("shape"), list):
        return False
    shape, dtype = feature["shape"], str(feature.get("dtype"))
    numeric = dtype.startswith(("float", "int", "uint", "bool"))
    sized = len(shape) == 1 and isinstance(shape[0], int) and 0 < shape[0] < MAX_ELEMENTS
    return numeric and sized


def read_episodes(path: Path, files: Sequence[Path]) -> dict[int, Episode]:
    """Returns the episodes by their index, in its order, with their files among `files`."""
    episodes = {}
    by_name = {"/".join(file.parts[-2:]): file for file in files}
    by_episode = {file.name: file for file in files}
    listed = path / "meta" / "episodes.jsonl"
    for row in _json_lines(listed) if listed.exists() else _table(path / "meta" / "episodes"):
        try:
            index = int(row["episode_index"])
            chunk, number = (row.get(name) for name in PLACE)
            file = by_episode.get(f"episode_{index:06d}.parquet")
            if chunk is not None and number is not None:
                file = by_name.get(f"chunk-{int(chunk):03d}/file-{int(number):03d}.parquet")
            task = str((row.get("tasks") or [""])[0])
            episodes[index] = Episode(int(row["length"]), task, file)
        except (AttributeError, LookupError, TypeError, ValueError, OverflowError):
            raise value_error(
                f"{path}: the metadata of an episode lack episode_index, length or tasks"
            ) from None
    if not episodes:
        raise value_error(f"{path}: no episodes in meta")
    return dict(sorted(episodes.items()))


def _json_lines(file: Path) -> Iterator[dict[str, Any]]:
    for line in file.read_bytes().splitlines():
        if line.strip():
            yield _json(file, line)


def _json(file: Path, data: bytes) -> Any:
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        raise value_error(f"{file}: not JSON, or damaged: {error}") from None


def _table(folder: Path) -> Iterator[dict[str, Any]]:
    """Yields the rows of the tables of episodes, without statistics."""
    parquet = load("pyarrow.parquet", "lerobot", "LeRobot data sets")
    for file in sorted(folder.glob("*/*.parquet")):
        with reading(file, "Parquet"):
            table = parquet.ParquetFile(file)
            names = ("episode_index", "length", "tasks", *PLACE)
            columns = [name for name in names if name in table.schema_arrow.names]
            rows = table.read(columns=columns).to_pylist()
        yield from rows


def matrix(column: Any) -> NDArray[np.float64]:
    """Returns a column of numbers or of lists of equal length as (T, n), with NaN for null."""
    compute = load("pyarrow.compute", "lerobot", "LeRobot data sets")
    column = column.combine_chunks()
    n_rows, n_elements = len(column), 1
    if hasattr(column.type, "value_field"):
        lengths = compute.list_value_length(column).unique().to_pylist()
        if len(lengths) > 1 or None in lengths:
            raise ValueError("a column of lists of different lengths")
        n_elements = lengths[0] if lengths else 1
        column = compute.list_flatten(column)
    values = np.asarray(column.to_numpy(zero_copy_only=False), float)
    return values.reshape(n_rows, n_elements)


def interval(time: NDArray[np.float64], fps: Any) -> float | None:
    """Returns 1/fps if the time stamps, in single precision, are its multiples, or else None."""
    if not isinstance(fps, (int, float)) or not 0 < fps < 1e6 or not len(time):
        return None
    steps = np.round(time * fps)
    close = np.abs(steps / fps - time) <= 1e-6 * np.abs(time) + 1e-9
    return float(1 / fps) if close.all() and (np.diff(steps) == 1).all() else None
