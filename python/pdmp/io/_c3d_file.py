"""Points and parameters of a C3D file.

The package ezc3d, which writes and reads such files, does not return from some damaged ones.
See https://www.c3d.org/HTML/default.htm for the format: a header, parameters and frames, in blocks
of 512 bytes.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

BLOCK = 512
INTEL, DEC, MIPS = 84, 85, 86
"""Processors, which differ in the order of bytes and in floating-point numbers."""
MAX_STATED = 65535
"""Number of frames that a file with more frames states."""
WIDTHS = {-1: 1, 1: 1, 2: 2, 4: 4}
"""Bytes of an element of a parameter by its type: text, bytes, integers and reals."""
Parameters = dict[str, list[Any]]


@dataclass(frozen=True)
class Numbers:
    """Numbers of a processor."""

    processor: int

    def decode(self, data: bytes, width: int, *, real: bool) -> NDArray[Any]:
        """Returns integers or reals of a width in bytes."""
        order = ">" if self.processor == MIPS else "<"
        if real and self.processor == DEC:
            # A DEC real has its 16-bit words swapped, and four times the value in IEEE form.
            words = np.frombuffer(data, "<u2").reshape(-1, 2)[:, ::-1]
            return np.ascontiguousarray(words).view("<f4")[:, 0] / 4
        return np.frombuffer(data, f"{order}{'f' if real else 'i'}{width}")


def read(data: bytes) -> tuple[NDArray[np.float64], Parameters]:
    """Returns points (T, N, 3), NaN where hidden, and parameters such as "POINT:LABELS".

    Raises
    ------
    ValueError
        Another format, or a file that is shorter than it states.
    """
    if len(data) < 2 * BLOCK or data[1] != 0x50:
        raise ValueError("it has no header of C3D")
    place = (data[0] - 1) * BLOCK
    if place < 0 or place + 4 > len(data) or data[place + 3] not in (INTEL, DEC, MIPS):
        raise ValueError("its parameters are missing")
    numbers = Numbers(data[place + 3])
    parameters = _parameters(data, place, numbers)
    n_points, n_analogue, first, last = (
        int(n) & 0xFFFF for n in numbers.decode(data[2:10], 2, real=False)
    )
    scale = float(numbers.decode(data[12:16], 4, real=True)[0])
    block = int(numbers.decode(data[16:18], 2, real=False)[0]) & 0xFFFF
    width = 4 if scale < 0 else 2
    size = (4 * n_points + n_analogue) * width
    begin = (block - 1) * BLOCK
    n_frames = _n_frames(parameters, first, last)
    if n_frames == MAX_STATED and size:
        n_frames = _n_written(data, parameters, begin, size)
    if block < 2 or n_frames < 0 or begin + n_frames * size > len(data):
        raise ValueError(f"it is shorter than {n_frames} frames of {size} bytes")
    frames = numbers.decode(data[begin : begin + n_frames * size], width, real=scale < 0)
    frames = frames.reshape(n_frames, 4 * n_points + n_analogue)[:, : 4 * n_points]
    points = frames.reshape(n_frames, n_points, 4).astype(float)
    hidden = points[:, :, 3] < 0
    points = points[:, :, :3] * (1.0 if scale < 0 else scale)
    points[hidden] = np.nan
    return points, parameters


def _n_frames(parameters: Parameters, first: int, last: int) -> int:
    """Returns the number of frames; the header and POINT:FRAMES have 16 bits."""
    begin, end = (parameters.get(f"TRIAL:ACTUAL_{name}_FIELD") for name in ("START", "END"))
    if begin and end and len(begin) == len(end) == 2:
        low, high = (
            (int(words[0]) & 0xFFFF) + 0x10000 * (int(words[1]) & 0xFFFF) for words in (begin, end)
        )
        if (high - low) & 0xFFFF == (last - first) & 0xFFFF:
            return high - low + 1
    stated = parameters.get("POINT:FRAMES") or [0]
    if isinstance(stated[0], float) and stated[0] > 0xFFFF and np.isfinite(stated[0]):
        return int(stated[0])
    return last - first + 1


def _n_written(data: bytes, parameters: Parameters, begin: int, size: int) -> int:
    """Returns the number of frames up to the next section, or to the zeros that fill a block."""
    following = (parameters.get("ROTATION:DATA_START") or [0])[0]
    end = (int(following) & 0xFFFF) * BLOCK - BLOCK
    end = end if begin < end <= len(data) else len(data)
    n_frames = (end - begin) // size
    while n_frames > MAX_STATED and not any(data[begin + (n_frames - 1) * size :][:size]):
        n_frames -= 1
    return n_frames


def _parameters(data: bytes, place: int, numbers: Numbers) -> Parameters:
    """Returns the values of the parameters by group and name."""
    groups: dict[int, str] = {}
    found: dict[tuple[int, str], list[Any]] = {}
    place += 4
    while place + 2 <= len(data) and data[place]:
        length, group = abs(struct.unpack_from("b", data, place)[0]), data[place + 1]
        name = data[place + 2 : place + 2 + length].decode("latin-1").upper().strip()
        place += 2 + length
        step = int(numbers.decode(_slice(data, place, 2), 2, real=False)[0]) & 0xFFFF
        if group > 127:
            groups[256 - group] = name
        elif group:
            found[group, name] = _values(data, place + 2, numbers)
        if step < 2:
            break
        place += step
    return {f"{groups.get(group, group)}:{name}": values for (group, name), values in found.items()}


def _values(data: bytes, place: int, numbers: Numbers) -> list[Any]:
    """Returns the elements of a parameter; texts along the first axis."""
    kind, n_dims = struct.unpack("bB", _slice(data, place, 2))
    if kind not in WIDTHS:
        raise ValueError(f"it has a parameter of type {kind}")
    dims = list(_slice(data, place + 2, n_dims))
    n_elements = int(np.prod(dims, dtype=np.int64)) if n_dims < 8 else len(data)
    raw = _slice(data, place + 2 + n_dims, n_elements * WIDTHS[kind])
    if kind == -1:
        length = dims[0] if dims else 1
        count = n_elements // length if length else 0
        texts = [raw[k * length : (k + 1) * length] for k in range(count)]
        return [text.decode("utf-8", "replace").strip("\0 ") for text in texts]
    return numbers.decode(raw, WIDTHS[kind], real=kind == 4).tolist()  # type: ignore[no-any-return]


def _slice(data: bytes, place: int, size: int) -> bytes:
    if place + size > len(data):
        raise ValueError("a parameter exceeds the file")
    return data[place : place + size]
