"""A demonstration whose errors name the file it came from."""

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from pdmp._native import Demonstration


def demonstration(source: Path | str, position: NDArray[Any], **given: Any) -> Demonstration:
    """Return `Demonstration(position, **given)`, with `source` before the text of its errors."""
    try:
        return Demonstration(position, **given)
    except ValueError as error:
        raise ValueError(f"{source}: {error}") from None
