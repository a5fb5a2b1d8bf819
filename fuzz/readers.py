"""Searches for files on which a reader of recordings breaks its claim.

The claim: a file becomes demonstrations in finite numbers, or is refused by a ValueError or an
OSError, in a time and memory that fit its size. Files are changed at random; those that reach new
lines of the readers are kept and changed further. The status is 1 if a file broke the claim. The
tests replay `corpus/` by the same `check`.
"""

import argparse
import io
import random
import re
import resource
import sys
import tempfile
import time
import traceback
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np

import pdmp

CORPUS = Path(__file__).parent / "corpus"
READERS: dict[str, Callable[..., Any]] = {
    "csv": pdmp.io.read_csv,
    "bvh": pdmp.io.read_bvh,
    "npz": pdmp.io.read_npz,
    "opensim": pdmp.io.read_opensim,
    "c3d": pdmp.io.read_c3d,
    "mat": pdmp.io.read_mat,
}
REFUSALS = (ValueError, OSError)
MAX_SIZE = 1 << 14  # bytes of a changed file; larger ones only take longer
MAX_SECONDS = 5.0  # for one file
MAX_MEMORY = 4 << 30  # bytes of addresses; readers of such files need far less
TRACED_SHARE = 8  # one in so many files is traced
TRACED = ("/pdmp/", "/bvh", "/zipfile", "/numpy/lib/")

TABLE = "t,x [m],y\n" + "".join(f"{k / 64},{k * k / 9},{-k / 7}\n" for k in range(12))
BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 3 Xposition Zrotation Xrotation
  JOINT Leg
  {
    OFFSET 0 -40 0
    CHANNELS 1 Zrotation
    End Site
    {
      OFFSET 0 -40 0
    }
  }
}
MOTION
Frames: 6
Frame Time: 0.01
""" + "".join(f"{k} {k * k} 0 {k / 8}\n" for k in range(6))
# fmt: off
TOKENS: dict[str, list[str]] = {
    "csv": [
        ",", ";", "\t", "\n", "\r\n", " ", "\"", "'", "#", "NaN", "nan", "-nan", "null", "NA",
        "inf", "1e400", "0x1p3", "1_0", "\ufeff", "\x00", "t", "time", "[s]", "[ms]", "[ns]",
        "(ms)", "Frame", "index", "µs", "1,5", "1.000,5", "sep=;\n",
    ],
    "bvh": [
        "HIERARCHY", "ROOT ", "JOINT ", "End Site", "{", "}", "OFFSET", "CHANNELS", "MOTION",
        "Frames:", "Frame Time:", "Xposition", "Yrotation", " 0", " -1", " nan", " inf",
        "99999999999999999999", "\n", "\t", "\x00", "\ufeff",
    ],
    "npz": [],
    "opensim": [
        "\t", "\n", " ", "PathFileType", "NumFrames", "Frame#", "Time", "time", "endheader",
        "nRows=", "inDegrees=yes", "nan", "-1", "99999999999999999999", "\x00", "\ufeff",
    ],
    "c3d": [],
    "mat": [],
}
NUMBERS = [
    "0", "-0", "1", "-1", "2", "1e-9", "1e9", "1e308", "1e-320", "nan", "inf", "1.5.2",
    "18446744073709551616", "1699999999123456789",
]
DESCRIPTIONS = [
    "<f8", ">f8", "<f4", "<f2", "<f16", "|b1", "|u1", "<i8", "|O", "<c16", "<U3", "|S2",
    "<M8[ns]", "|V8", "|V0",
]
SHAPES = [
    "()", "(0,)", "(1,)", "(24,)", "(12, 2)", "(12, -2)", "(2, 12, 1)",
    "(4294967296, 4294967296)", "(1099511627776,)", "(1.5,)",
]
# fmt: on


def check(target: str, path: Path) -> None:
    """Reads a file with and without options, and asserts the claim."""
    start = time.perf_counter()
    for options in ({}, {"dt": 0.01, "max_gap": 0.1}):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                found = READERS[target](path, **options)
            except REFUSALS:
                continue
        for demo in found.values() if isinstance(found, dict) else [found]:
            assert np.isfinite(demo.position).all(), "a position is not finite"
            clock = [0.0, demo.dt or 1.0] if demo.time is None else demo.time
            assert np.isfinite(clock).all() and (np.diff(clock) > 0).all(), "time does not increase"
    assert time.perf_counter() - start < MAX_SECONDS, "it took too long"


def seeds(target: str) -> list[bytes]:
    """Returns sound files, and those of the corpus."""
    rng = np.random.default_rng(1)
    y, t = rng.normal(size=(12, 2)).cumsum(0), np.arange(12) / 64
    made = {
        "csv": [
            TABLE.encode(),
            TABLE.replace(",", ";").encode(),
            b"x,y\n" + b"1.5,2\n,nan\n3,4\n" * 3,
        ],
        "bvh": [BVH.encode()],
        "npz": [
            _archive({"a": y, "a.t": t, "names": np.array(["x", "y"])}),
            _archive({"y": y, "start": np.array([0, 6, 12]), "t": t, "units": np.array(["m", ""])}),
            _archive({"time": t, "position": y}),
        ],
    }
    return made.get(target, []) + [
        path.read_bytes() for path in sorted((CORPUS / target).glob("*"))
    ]


def _archive(arrays: dict[str, Any]) -> bytes:
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def change(target: str, data: bytes, other: bytes, rng: random.Random) -> bytes:
    """Returns a file that was changed a few times."""
    for _ in range(rng.choice([1, 1, 2, 3, 5])):
        if target == "npz" and rng.random() < 0.7:
            data = _change_archive(data, rng)
        else:
            data = _change_bytes(data, other, TOKENS[target], rng)
        if len(data) > MAX_SIZE:
            data = data[:MAX_SIZE]
    return data


def _change_bytes(data: bytes, other: bytes, tokens: list[str], rng: random.Random) -> bytes:
    a, b = sorted(rng.randrange(len(data) + 1) for _ in range(2))
    b = min(b, a + rng.choice([1, 4, 16, 64, 1024]))
    lines = data.split(b"\n")
    match rng.randrange(9):
        case 0:
            return (
                data[:a]
                + bytes(rng.randrange(256) for _ in range(rng.choice([1, 1, 4])))
                + data[b:]
            )
        case 1:
            return data[:a] + data[b:]
        case 2:
            return data[:b] + data[a:b] * rng.choice([1, 1, 1, 2, 2, 2, 20, 20, 2000]) + data[b:]
        case 3:
            return data[:a] + other[a:]
        case 4 if tokens:
            token = rng.choice(tokens).encode() * rng.choice([1, 1, 1, 1, 1, 1, 1, 1, 2, 1500])
            return data[:a] + token + data[rng.choice([a, b]) :]
        case 5 if found := list(re.finditer(rb"-?\d[\d.e-]*", data)):
            place = rng.choice(found)
            return data[: place.start()] + rng.choice(NUMBERS).encode() + data[place.end() :]
        case 6:
            i, j = (rng.randrange(len(lines)) for _ in range(2))
            lines[i], lines[j] = lines[j], lines[i]
            return b"\n".join(lines)
        case 7:
            i = rng.randrange(len(lines))
            lines[i : i + 1] = [lines[i]] * rng.choice([0, 2, 10])
            return b"\n".join(lines)
        case _ if a < len(data):
            return data[:a] + bytes([data[a] ^ 1 << rng.randrange(8)]) + data[a + 1 :]
    return data


def _change_archive(data: bytes, rng: random.Random) -> bytes:
    """Changes one array of an archive, and puts all together again with checksums that hold."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = [(name, archive.read(name)) for name in archive.namelist()]
    except Exception:
        return data
    if not members or sum(len(body) for _, body in members) > MAX_SIZE:
        return data
    k = rng.randrange(len(members))
    name, body = members[k]
    match rng.randrange(6):
        case 0:
            names = [
                "y",
                "start",
                "t",
                "names",
                "units",
                "a",
                "a.t",
                "time",
                "position",
                "",
                "../y",
            ]
            name = rng.choice(names) + rng.choice([".npy", ".npy", ""])
        case 1:
            del members[k]
            k, name = len(members), name if rng.random() < 0.2 else ""
        case 2:
            body = _change_bytes(body, body, [], rng)
        case 3:
            body = re.sub(
                rb"'descr': [^,]*", f"'descr': '{rng.choice(DESCRIPTIONS)}'".encode(), body
            )
        case 4:
            body = re.sub(rb"\([^)]*\)", rng.choice(SHAPES).encode(), body, count=1)
        case 5:
            body = body[: rng.choice([0, 6, 8, 10, 128, len(body) // 2])]
    if name:
        members[k : k + 1] = [(name, body)]
    file = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(file, "w") as archive:
        warnings.simplefilter("ignore")  # two members of one name
        for name, body in members:
            archive.writestr(name, body, rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED]))
    return file.getvalue()


class Search:
    """One target: the files that reached new lines, and those that broke the claim."""

    def __init__(self, target: str, found: Path | None) -> None:
        self.target, self.folder = target, found
        self.kept: list[bytes] = []
        self.lines: set[tuple[CodeType, int]] = set()
        self.traced: dict[str, bool] = {}
        self.reasons: dict[str, int] = {}
        self.executions = 0

    def run(self, seconds: float, path: Path) -> None:
        """Changes files for `seconds`."""
        rng = random.Random(zlib.crc32(self.target.encode()))
        start = time.monotonic()
        for data in seeds(self.target):
            self.attempt(data, path)
            self.kept.append(data)
        while time.monotonic() - start < seconds:
            data, other = (rng.choice(self.kept) for _ in range(2))
            self.attempt(change(self.target, data, other, rng), path)

    def attempt(self, data: bytes, path: Path) -> None:
        """Checks one file, and keeps it if it reached new lines or broke the claim."""
        known = len(self.lines)
        reason = self.reason(data, path)
        if reason is not None:
            self.reasons[reason] = self.reasons.get(reason, 0) + 1
            if self.reasons[reason] == 1:
                self.save("broken", self.smaller(data, reason, path))
        elif len(self.lines) > known:
            self.kept.append(data)
            self.save("line", data)

    def reason(self, data: bytes, path: Path) -> str | None:
        """Returns the kind and place of the error that a file ends in, if it breaks the claim."""
        self.executions += 1
        path.write_bytes(data)
        # Tracing takes ten times as long as reading.
        if self.executions % TRACED_SHARE == 0 or self.executions < 100:
            sys.settrace(self.trace)
        try:
            check(self.target, path)
        except Exception as error:
            frames = [f for f in traceback.extract_tb(error.__traceback__) if "pdmp" in f.filename]
            place = f"{Path(frames[-1].filename).name}:{frames[-1].name}" if frames else "?"
            text = str(error) if isinstance(error, AssertionError) else ""
            return f"{type(error).__name__} in {place} {text}".strip()
        finally:
            sys.settrace(None)
        return None

    def trace(self, frame: FrameType, event: str, _: object) -> Any:
        """Traces the lines of the readers and of what they call."""
        name = frame.f_code.co_filename
        if name not in self.traced:
            self.traced[name] = any(part in name for part in TRACED)
        return self.line if self.traced[name] else None

    def line(self, frame: FrameType, event: str, _: object) -> Any:
        """Notes a line."""
        self.lines.add((frame.f_code, frame.f_lineno))
        return self.line

    def smaller(self, data: bytes, reason: str, path: Path) -> bytes:
        """Returns a part of a file that ends in the same error."""
        size = len(data) // 2
        while size:
            place = 0
            while place < len(data):
                shorter = data[:place] + data[place + size :]
                if self.reason(shorter, path) == reason:
                    data = shorter
                else:
                    place += size
            size //= 4
        return data

    def save(self, kind: str, data: bytes) -> None:
        """Writes a file beside those found before."""
        if self.folder is not None:
            folder = self.folder / self.target
            folder.mkdir(parents=True, exist_ok=True)
            (folder / f"{kind}-{zlib.crc32(data):08x}").write_bytes(data)


def main(arguments: Iterable[str] | None = None) -> int:
    """Searches in each target, prints a summary, and returns 1 if a file breaks the claim."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="target", help=f"of {', '.join(READERS)}")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--found", type=Path)
    given = parser.parse_args(arguments)
    resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
    broken = 0
    for target in given.targets or READERS:
        search = Search(target, given.found)
        with tempfile.TemporaryDirectory() as folder:
            search.run(given.seconds, Path(folder) / f"file.{target}")
        print(
            f"{target}: {search.executions} files in {given.seconds:.0f} s, "
            f"{len(search.lines)} lines reached, {len(search.kept)} files kept, "
            f"{len(search.reasons)} kinds of error"
        )
        for reason, times in search.reasons.items():
            print(f"  {times} times {reason}")
        broken += len(search.reasons)
    return int(broken > 0)


if __name__ == "__main__":
    sys.exit(main())
