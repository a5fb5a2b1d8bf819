"""Reader of BVH files, the channels of a skeleton in motion capture."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pdmp._files import file_path
from pdmp._labels import name_list
from pdmp._messages import value_error
from pdmp._native import Demonstration
from pdmp.io import _fields
from pdmp.io._demonstration import Options, make_demonstration

if TYPE_CHECKING:
    from bvh import Bvh


def read_bvh(
    path: str | PathLike[str],
    *,
    columns: Sequence[str] | None = None,
    dt: float | None = None,
    max_gap: float = 0.0,
    context: Sequence[float | str] | None = None,
) -> Demonstration:
    """Reads one demonstration from a BVH file; needs the extra `bvh`.

    Each channel is a degree of freedom, named after joint and channel, such as `LeftLeg.Xrotation`.
    Rotations are converted from degrees to rad, without jumps by full turns. Positions are in the
    unit of the file, which the format does not state.

    Parameters
    ----------
    path : path
        A BVH file, whose joints may have any channels in any order.
    columns : sequence of str, optional
        Names of the degrees of freedom to keep, in this order; all by default.
    dt : float, optional
        Sampling interval [s], instead of the file's frame time.
    max_gap : float
        Longest gap [s], a run of NaN, to interpolate; by default 0, none.
    context : sequence of float or str, optional
        Context (Q,) of the demonstration.

    Raises
    ------
    ImportError
        The package bvh is not installed.
    ValueError
        A file that is not BVH or incomplete, a missing channel, or data that `Demonstration`
        rejects.
    OSError
        A file that cannot be read.
    """
    Options(columns, dt, max_gap)
    path = file_path(path)
    motion = _parsed(path)
    try:
        channels = [
            f"{' '.join(joint.value[1:])}.{channel}"
            for joint in motion.get_joints()
            for channel in joint["CHANNELS"][1:]
        ]
        n_frames, interval = motion.nframes, motion.frame_time
    except Exception:
        # The parser raises various built-in errors.
        raise value_error(
            f"{path}: an incomplete BVH file: joints, channels or frames are missing"
        ) from None
    if len(motion.frames) != n_frames:
        raise value_error(
            f"{path}: has {len(motion.frames)} frames, but states {n_frames}: export it again"
        )
    names = channels if columns is None else name_list("columns", columns)
    indices = _fields.column_indices(path, channels, names)
    position = np.array([_frame(path, k, row, channels) for k, row in enumerate(motion.frames)])
    position = position.reshape(n_frames, len(channels))[:, indices]
    rotational = np.array([name.endswith("rotation") for name in names], bool)
    # Programs write angles within a turn. A gap, which is NaN, has no turns to count across.
    steady = rotational & np.isfinite(position).all(0)
    position[:, rotational] = np.deg2rad(position[:, rotational])
    position[:, steady] = np.unwrap(position[:, steady], axis=0)
    return make_demonstration(
        path,
        position,
        dt=interval if dt is None else dt,
        time=None,
        names=names,
        units=["rad" if rotation else "" for rotation in rotational],
        max_gap=max_gap,
        context=context,
    )


def _parsed(path: Path) -> Bvh:
    try:
        from bvh import Bvh
    except ImportError:
        raise ImportError("BVH files need the package bvh: pip install 'pdmp[bvh]'") from None
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise value_error(f"{path}: not UTF-8 text: save it as UTF-8") from None
    try:
        # The parser reads a blank line as a joint, and needs a line break after the last frame.
        return Bvh("\n".join(line for line in lines if line.strip()) + "\n")
    except Exception:
        raise value_error(f"{path}: not a BVH file: its braces do not match") from None


def _frame(path: Path, frame: int, row: Sequence[str], names: Sequence[str]) -> list[float]:
    if len(row) != len(names):
        raise value_error(f"{path}, frame {frame}: {len(row)} numbers, expected {len(names)}")
    numbers = []
    for name, field in zip(names, row, strict=True):
        try:
            numbers.append(float(field))
        except ValueError:
            raise value_error(
                f"{path}, frame {frame}, '{name}': '{field}' is not a number"
            ) from None
    return numbers
