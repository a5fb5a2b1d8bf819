"""Damaged and forged files raise a ValueError or an OSError, at a cost bounded by their size.

Run as a script, with a number of files of each kind, it searches further than the tests do.
"""

import io
import struct
import sys
import tempfile
import tracemalloc
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import pdmp
from synthetic import BVH

CASES = 250  # of each kind
RNG = np.random.default_rng(7)
POSITION = np.round(np.cumsum(RNG.normal(size=(40, 2)), axis=0), 3)


def archive(save: Callable[..., None], **arrays: object) -> bytes:
    """Returns the bytes of an NPZ file."""
    file = io.BytesIO()
    save(file, **arrays)
    return file.getvalue()


TIME = np.arange(40) / 64
TABLE = "t,x [m],y\n" + "".join(
    f"{t},{x},{y}\n" for t, (x, y) in zip(TIME.tolist(), POSITION.tolist(), strict=True)
)
INDEX = "id,height\na,1.5\nb,2\n"
SEEDS: dict[str, list[bytes]] = {
    ".csv": [
        TABLE.encode(),
        ("sep=;\n# angles\n" + TABLE.replace(",", ";").replace(".", ",")).encode(),
        ("t\tx\ty\ns\tm\tm\n" + TABLE.replace(",", "\t").split("\n", 1)[1]).encode("utf-16"),
    ],
    ".npz": [
        archive(np.savez_compressed, a=POSITION, **{"a.t": TIME}),
        archive(np.savez, position=POSITION, time=TIME, names=["x", "y"], units=["m", ""]),
        archive(np.savez, y=POSITION, t=np.tile(TIME[:20], 2), start=[0, 20, 40], names=["x", "y"]),
    ],
    ".bvh": [BVH.encode()],
    "index": [INDEX.encode()],
    # Damaged before the checksum is made.
    "npy": [archive(np.savez, position=POSITION, time=TIME, names=["x", "y"])],
}
TOKENS = [b"\x00", b"\xff", b"nan", b"1e999", b"-", b",", b";", b'"', b"\n", b"{", b"}", b"(" * 90,
          b"[" * 90, b"999999999999", b"sep=", b"#", b"\x1b[2J", b"JOINT", b"1_0"]  # fmt: skip


def damaged(raw: bytes, random: np.random.Generator) -> bytes:
    """Returns a file with some bytes changed, deleted, repeated, replaced or truncated."""
    made = bytearray(raw)
    for _ in range(random.integers(1, 5)):
        at, until = sorted(random.integers(0, len(made) + 1, 2).tolist())
        kind = random.integers(7)
        if kind < 2 and at < len(made):
            made[at] = random.integers(256)
        elif kind == 2:
            made[at : min(until, at + 40)] = b""
        elif kind == 3:
            made[at:at] = made[at : min(until, at + 200)]
        elif kind == 4:
            made[at:at] = TOKENS[random.integers(len(TOKENS))]
        elif kind == 5:
            token = TOKENS[random.integers(len(TOKENS))]
            made[at : at + len(token)] = token
        elif random.random() < 0.3:
            del made[at:]
    return bytes(made)


def members_damaged(raw: bytes, random: np.random.Generator) -> bytes:
    """Returns an archive with valid checksums and a damaged member."""
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(raw)) as old, zipfile.ZipFile(made, "w") as new:
        chosen = random.integers(len(old.namelist()))
        for m, name in enumerate(old.namelist()):
            member = old.read(name)
            new.writestr(
                name, damaged(member[:150], random) + member[150:] if m == chosen else member
            )
    return made.getvalue()


def headed(header: bytes, data: bytes = b"", version: bytes = b"\x01\x00") -> bytes:
    """Returns an NPY file with this header."""
    form = "<H" if version == b"\x01\x00" else "<I"
    return b"\x93NUMPY" + version + struct.pack(form, len(header)) + header + data


def zipped(member: bytes, name: str = "a.npy", **fields: int) -> bytes:
    """Returns an NPZ file of one member, with fields of its directory forged."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as opened:
        opened.writestr(name, member)
    raw = bytearray(file.getvalue())
    directory = raw.index(b"PK\x01\x02")
    for field, value in fields.items():
        at = {"method": 10, "crc": 16, "compressed": 20, "size": 24, "flags": 8}[field]
        struct.pack_into("<I" if at > 10 else "<H", raw, directory + at, value)
    return bytes(raw)


def described(shape: str, dtype: str = "'<f8'", more: str = "") -> bytes:
    """Returns the text of an NPY header."""
    return f"{{'descr': {dtype}, 'fortran_order': False, 'shape': {shape}{more}}}\n".encode()


FORGED = {
    "an enormous shape": zipped(headed(described("(1000000000000, 2)"))),
    "an overflowing shape": zipped(headed(described("(4611686018427387904, 4)"))),
    "a negative shape": zipped(headed(described("(-1, 2)"), bytes(64))),
    "a shape of truth": zipped(headed(described("(True, 2)"), bytes(16))),
    "no bytes each": zipped(headed(described("(1000000000000, 2)", "'|V0'"))),
    "objects": zipped(headed(described("(2, 2)", "'|O'"), bytes(32))),
    "a deep header": zipped(headed(b"(" * 9000)),
    "a deeper header": zipped(headed(b"[" * 60000)),
    "a deep shape": zipped(headed(described("(" * 3000 + ")" * 3000))),
    "a deep dtype": zipped(headed(described("(4,)", "[('a'," * 400 + "'f8'" + ")]" * 400))),
    "a sum of minuses": zipped(headed(described("-" * 5000 + "1"))),
    "a long header": zipped(headed(b" " * 10**6, version=b"\x02\x00")),
    "a header that is cut": zipped(b"\x93NUMPY\x02\x00\xff\xff\xff\xff{"),
    "another version": zipped(headed(b"{}", version=b"\x09\x00")),
    "a text member": zipped(b"hello", "y.txt"),
    "a text called an array": zipped(b"hello"),
    "a size that lies": zipped(headed(described("(100000000, 2)")), size=1_600_000_128),
    "a longer size": zipped(headed(described("(4, 2)"), bytes(64)), size=2**31),
    "another checksum": zipped(headed(described("(4, 2)"), bytes(64)), crc=1),
    "an unknown method": zipped(headed(described("(4, 2)"), bytes(64)), method=97),
    "encryption": zipped(headed(described("(4, 2)"), bytes(64)), flags=1),
    "texts": archive(np.savez, time=TIME.astype(str), position=POSITION.astype(str)),
    "dates": archive(np.savez, time=TIME, position=np.zeros((40, 2), "M8[s]")),
    "records": archive(np.savez, time=TIME, position=np.zeros(40, [("x", "f8"), ("y", "f8")])),
    "scalars": archive(np.savez, y=1.0, t=2.0, start=3),
    "infinite starts": archive(np.savez, y=POSITION, t=TIME, start=[0, np.inf]),
    "names of numbers": archive(np.savez, position=POSITION, time=TIME, names=[1, 2]),
    "a name of bad letters": archive(
        np.savez, position=POSITION, time=TIME, names=np.array([b"\xff", b"b"])
    ),
}


def readers(kind: str, folder: Path) -> Iterator[tuple[Path, Callable[[], object]]]:
    """Yields a path for a file of a kind, and a function that reads it."""
    path = folder / f"damaged{'.npz' if kind == 'npy' else kind}"
    if kind == ".csv":
        yield path, lambda: [pdmp.io.read_csv(path, max_gap=1.0)]
        yield path, lambda: [pdmp.io.read_csv(path, dt=0.1)]
    elif kind in (".npz", "npy"):
        yield path, lambda: pdmp.io.read_npz(path).values()
        yield path, lambda: pdmp.io.read_npz(path, dt=0.1, max_gap=1.0).values()
    elif kind == ".bvh":
        yield path, lambda: [pdmp.io.read_bvh(path)]
    else:
        (folder / "demos").mkdir(exist_ok=True)
        for name in "ab":
            (folder / "demos" / f"{name}.csv").write_text(TABLE)
        yield folder / "index.csv", lambda: pdmp.io.read_folder(folder, context=["height"]).values()


def attempt(read: Callable[[], object]) -> str:
    """Returns "read", "rejected", or the type of an error that a damaged file must not raise."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            found = list(read())  # type: ignore[call-overload]
    except (ValueError, OSError) as error:
        assert not set(str(error)) & set(map(chr, range(32))), f"control characters: {error!r}"
        return "rejected"
    except Exception as error:
        return f"{type(error).__module__}.{type(error).__name__}: {error}"
    assert all(np.isfinite(demo.position).all() for demo in found)
    return "read"


def search(kind: str, folder: Path, cases: int, seed: int) -> Counter[str]:
    """Returns the counts of results for damaged files of a kind."""
    random, outcomes = np.random.default_rng(seed), Counter[str]()
    for path, read in readers(kind, folder):
        for case in range(cases):
            seed_bytes = SEEDS[kind][case % len(SEEDS[kind])]
            change = members_damaged if kind == "npy" else damaged
            path.write_bytes(change(seed_bytes, random))
            outcomes[attempt(read)] += 1
    return outcomes


@pytest.mark.parametrize("kind", SEEDS)
def test_damaged_files_are_rejected(tmp_path: Path, kind: str) -> None:
    """Of hundreds of damaged files of each kind, all are read or rejected, and both occur."""
    if kind == ".bvh":
        pytest.importorskip("bvh")
    outcomes = search(kind, tmp_path, CASES, seed=0)
    assert set(outcomes) == {"read", "rejected"}


@pytest.mark.parametrize("raw", FORGED.values(), ids=FORGED)
def test_forged_archives_are_rejected(tmp_path: Path, raw: bytes) -> None:
    """Forged headers raise a ValueError or an OSError, without allocating their stated size."""
    path = tmp_path / "forged.npz"
    path.write_bytes(raw)
    tracemalloc.start()
    try:
        for dt in (None, 0.1):
            assert attempt(lambda dt=dt: pdmp.io.read_npz(path, dt=dt).values()) == "rejected"
        assert tracemalloc.get_traced_memory()[1] < 50e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("kind", SEEDS)
def test_files_cut_off_are_rejected_or_shorter(tmp_path: Path, kind: str) -> None:
    """A truncated file is rejected, or its beginning is read."""
    if kind == ".bvh":
        pytest.importorskip("bvh")
    for path, read in readers(kind, tmp_path):
        for raw in SEEDS[kind]:
            for end in range(0, len(raw), 1 + len(raw) // 60):
                path.write_bytes(raw[:end])
                assert attempt(read) in ("read", "rejected")


def test_deep_hierarchies_are_rejected(tmp_path: Path) -> None:
    """A skeleton of ten thousand nested joints does not exhaust the stack."""
    pytest.importorskip("bvh")
    path = tmp_path / "deep.bvh"
    joint = "JOINT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n"
    path.write_text(BVH.replace("JOINT Left Leg", joint * 10_000 + "JOINT Left Leg"))
    assert attempt(lambda: [pdmp.io.read_bvh(path)]) == "rejected"


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        for kind in SEEDS:
            print(kind, dict(search(kind, Path(place), int(sys.argv[1]), seed=1)))
