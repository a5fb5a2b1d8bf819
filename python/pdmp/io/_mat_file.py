"""Variables of a MAT file of version 5 to 7, as MATLAB and Octave write it.

The reader of scipy ends the process at some damaged files. The format is described in "MAT-File
Format", MathWorks, chapter 1.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

MAX_DEPTH = 30
"""Largest depth of cells and structs within each other."""
HEADER = 128  # bytes
MATRIX, COMPRESSED, UTF8, UTF16, UTF32 = 14, 15, 16, 17, 18
TYPES = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
    UTF8: "u1", UTF16: "u2", UTF32: "u4",
}  # fmt: skip
"""Types of numbers and texts."""
CELL, STRUCT, TEXT = 1, 2, 4
NUMBERS = range(6, 16)
"""Classes of arrays of numbers, from double to uint64."""
IS_COMPLEX = 0x0800


def read(data: bytes) -> dict[str, Any]:
    """Returns the variables: arrays, texts, and lists of the cells, the structs and rows of texts.

    A struct is a dict. Variables of other classes, such as functions and sparse matrices, are None.

    Raises
    ------
    ValueError
        Another format, or a file whose parts do not fit together.
    """
    order = {b"IM": "<", b"MI": ">"}.get(data[126:HEADER])
    if order is None:
        raise ValueError("it has no header of MATLAB 5 to 7")
    reader = _Reader(order)
    variables = {}
    for kind, body in reader.elements(data, HEADER):
        if kind == COMPRESSED:
            kind, body = next(reader.elements(zlib.decompress(body), 0), (0, b""))
        if kind == MATRIX:
            name, value = reader.matrix(body, 0)
            variables[name] = value
    return variables


@dataclass(frozen=True)
class _Reader:
    """Elements in an order of bytes, "<" or ">"."""

    order: str

    def elements(self, data: bytes, place: int) -> Iterator[tuple[int, bytes]]:
        """Yields the types and bytes of elements that follow each other."""
        while place + 8 <= len(data):
            kind, size = struct.unpack_from(f"{self.order}II", data, place)
            begin = place + 8
            if kind > 0xFFFF:
                # An element of up to four bytes has its size in the upper half of its type.
                kind, size, begin = kind & 0xFFFF, kind >> 16, place + 4
                if size > 4:
                    raise ValueError("a small element has more than four bytes")
            if begin + size > len(data):
                raise ValueError("an element exceeds what it is part of")
            yield kind, data[begin : begin + size]
            place = begin + size
            if kind != COMPRESSED:
                place += -place % 8 if begin % 8 == 0 else 4 - size

    def matrix(self, body: bytes, depth: int) -> tuple[str, Any]:
        """Returns name and value of an array."""
        if depth > MAX_DEPTH:
            raise ValueError(f"cells and structs are nested more than {MAX_DEPTH} times")
        if not body:
            return "", np.empty((0, 0))
        parts = self.elements(body, 0)
        flags = int(self.numbers(*self.next(parts))[0])
        dims = [int(n) for n in self.numbers(*self.next(parts))]
        name = bytes(self.next(parts)[1]).decode("latin-1")
        kind, n_elements = flags & 0xFF, prod(dims)
        if min(dims, default=0) < 0 or n_elements > len(body):
            raise ValueError(f"'{name}' has {dims} elements, more than bytes")
        if kind == CELL:
            return name, [self.inner(parts, depth) for _ in range(n_elements)]
        if kind == STRUCT:
            width = int(self.numbers(*self.next(parts))[0])
            raw = self.next(parts)[1]
            if width < 1:
                raise ValueError(f"'{name}' has fields without names")
            fields = [raw[k : k + width].split(b"\0")[0] for k in range(0, len(raw), width)]
            names = [field.decode("latin-1") for field in fields]
            return name, [
                {each: self.inner(parts, depth) for each in names} for _ in range(n_elements)
            ]
        if kind == TEXT:
            return name, self.text(*self.next(parts), dims)
        if kind not in NUMBERS or flags & IS_COMPLEX:
            return name, None
        values = self.numbers(*self.next(parts))
        if len(values) != n_elements:
            raise ValueError(f"'{name}' has {len(values)} numbers, but states {dims}")
        return name, values.astype(float).reshape(dims, order="F")

    def next(self, parts: Iterator[tuple[int, bytes]]) -> tuple[int, bytes]:
        """Returns the next element."""
        part = next(parts, None)
        if part is None:
            raise ValueError("an array has fewer parts than its class")
        return part

    def inner(self, parts: Iterator[tuple[int, bytes]], depth: int) -> Any:
        """Returns the value of a cell or of a field."""
        kind, body = self.next(parts)
        if kind != MATRIX:
            raise ValueError(f"a cell or field of type {kind}")
        return self.matrix(body, depth + 1)[1]

    def numbers(self, kind: int, body: bytes) -> Any:
        """Returns the numbers of an element, at least one."""
        if kind not in TYPES:
            raise ValueError(f"numbers of type {kind}")
        return np.frombuffer(body, self.order + TYPES[kind])

    def text(self, kind: int, body: bytes, dims: list[int]) -> str | list[str]:
        """Returns a text, or the rows of a matrix of characters."""
        if kind == UTF8:
            letters = list(body.decode("utf-8", "replace"))
        else:
            codes = self.numbers(kind, body).tolist()
            letters = [chr(code) if 0 <= code < 0x110000 else "?" for code in codes]
        n_rows = max(dims[0], 1) if dims else 1
        rows = ["".join(letters[row::n_rows]).rstrip() for row in range(n_rows)]
        return rows if n_rows > 1 else rows[0]
