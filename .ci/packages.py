"""Checks the packages in dist/python: metadata, platform, size, and use beside numpy alone."""

import subprocess
import sys
import tarfile
import tempfile
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MAX_WHEEL = 3_000_000  # bytes
PROGRAM = """
import sys
from pathlib import Path
import numpy as np
import pdmp

t = np.linspace(0.0, 1.0, 120)[:, None]
bend = lambda h: np.hstack([t**2 * (3 - 2 * t), h * (4 * t * (1 - t)) ** 2])
model = pdmp.fit([pdmp.Demonstration(bend(h), dt=0.01) for h in (0.1, 0.2, 0.4)], n_styles=2)
model.save("reach.safetensors")
model = pdmp.load("reach.safetensors")
controller = model.controller(0.001, goal=[1.2, 0.1], style=model.styles[0])
while controller.step() == pdmp.Status.WORKING:
    pass
assert np.allclose(controller.position, [1.2, 0.1], atol=0.01), controller.position
assert Path(pdmp.__file__).is_relative_to(sys.prefix), pdmp.__file__
assert not {"matplotlib", "scipy", "pandas"} & set(sys.modules)
"""


def run(*command: str | Path, cwd: Path = ROOT) -> str:
    """Returns what a program prints, or ends with it where the program fails."""
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def check_wheel(wheel: Path) -> None:
    """Installs a wheel beside numpy alone, and moves a model with it and with its command line."""
    if (size := wheel.stat().st_size) > MAX_WHEEL:
        sys.exit(f"{wheel.name} has {size} bytes, more than {MAX_WHEEL}")
    names = zipfile.ZipFile(wheel).namelist()
    for needed in ("pdmp/py.typed", "pdmp/_native.pyi", "LICENSE-THIRD-PARTY"):
        if not any(name.endswith(needed) for name in names):
            sys.exit(f"{wheel.name} does not hold {needed}")
    if sys.platform == "linux":
        said = run(sys.executable, "-m", "auditwheel", "show", wheel)
        print(" ".join(said.split("\n\n")[0].split()))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        venv.create(folder / "venv", with_pip=True)
        programs = folder / "venv" / ("Scripts" if sys.platform == "win32" else "bin")
        run(programs / "python", "-m", "pip", "install", "--quiet", wheel)
        run(programs / "python", "-c", PROGRAM, cwd=folder)
        run(programs / "pdmp", "info", "reach.safetensors", cwd=folder)
    print(f"{wheel.name}: {size / 1e6:.2f} MB, learns and moves beside numpy alone")


def check_source(archive: Path) -> None:
    """Checks that a source distribution builds from what it holds."""
    with tarfile.open(archive) as members:
        paths = {name.partition("/")[2] for name in members.getnames()}
    for needed in ("Cargo.lock", "crates/pdmp-core/src/lib.rs", "LICENSE-MIT", "README.md"):
        if needed not in paths:
            sys.exit(f"{archive.name} does not hold {needed}")
    print(f"{archive.name}: {archive.stat().st_size / 1e6:.2f} MB")


def check_crate() -> None:
    """Checks that cargo has no objection to the crate."""
    said = run(*("cargo", "package", "--package", "pdmp-core"), "--no-verify", "--allow-dirty")
    if "warning" in said:
        sys.exit(said)
    print(said.strip().splitlines()[-1].strip())


if __name__ == "__main__":
    folder = ROOT / "dist" / "python"
    (wheel,) = folder.glob("*.whl")
    (archive,) = folder.glob("*.tar.gz")
    print(run(sys.executable, "-m", "twine", "check", "--strict", wheel, archive).strip())
    check_wheel(wheel)
    check_source(archive)
    check_crate()
