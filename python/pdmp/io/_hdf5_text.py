"""Texts of an HDF5 file, found without the HDF5 library.

The library does not return from a damaged heap of texts, or ends the process. The format is
described in "HDF5 File Format Specification", level 1E, global heap.
"""

import math
import mmap
import re
import struct
from pathlib import Path

SIGNATURE = b"GCOL\x01\0\0\0"
HEADER = 16
"""Bytes of the header of a heap, and of each of its objects."""
FREQUENCY = re.compile(rb'"control_freq"\s*:\s*(\d{1,9}(?:\.\d{1,9})?)')
"""Control frequency [Hz] in the description of the environment in JSON."""


def interval(path: Path) -> float | None:
    """Returns the interval of the control frequency that a file states, or None.

    Raises ValueError if the heaps of texts are damaged, or if it states several frequencies.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        place = data.find(SIGNATURE)
        while place >= 0:
            _check_heap(data, place)
            place = data.find(SIGNATURE, place + HEADER)
        found = {float(match[1]) for match in FREQUENCY.finditer(data)}
    if len(found) > 1:
        raise ValueError(f"it states the control frequencies {sorted(found)}")
    frequency = found.pop() if found else 0.0
    return 1 / frequency if math.isfinite(frequency) and frequency > 0 else None


def _check_heap(data: mmap.mmap, place: int) -> None:
    """Raises ValueError if the objects of a heap do not fill it."""
    end = place + HEADER
    if end <= len(data):
        end = place + struct.unpack_from("<Q", data, place + 8)[0]
    if end > len(data):
        raise ValueError("a heap exceeds the file")
    place += HEADER
    # Free space without a header may remain at the end.
    while place + HEADER <= end:
        index, _, size = struct.unpack_from("<HH4xQ", data, place)
        if index == 0:
            if size != end - place:
                raise ValueError("the free space of a heap does not fill it")
            return
        place += HEADER + -(-size // 8) * 8
    if place > end:
        raise ValueError("an object exceeds its heap")
