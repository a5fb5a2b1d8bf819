"""Arrays as text."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray


def packed(array: NDArray[Any]) -> dict[str, Any]:
    """Returns an array with its shape, its numbers little-endian in base64."""
    kind = "f32" if array.dtype == np.float32 else "f64"
    numbers = np.ascontiguousarray(array, dtype={"f32": "<f4", "f64": "<f8"}[kind])
    return {"shape": list(array.shape), kind: base64.b64encode(numbers.tobytes()).decode()}
