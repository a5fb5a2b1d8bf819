"""The installed C and C++ libraries, found by pkg-config and CMake after they were moved."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import pdmp

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples" / "c"
LANGUAGES = {
    "C": ("cc", "-std=c11", "control_loop.c", "reach"),
    "CXX": ("c++", "-std=c++17", "control_loop.cpp", "cycle"),
}
"""For each language, compiler, option, program and the model that it moves."""

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="`make install` is for Unix"),
    pytest.mark.skipif(
        not all(map(shutil.which, ["make", "cargo", "cc", "c++", "pkg-config"])),
        reason="make, cargo, a compiler or pkg-config not installed",
    ),
]


def run(*command: str | Path, cwd: Path | None = None, **environment: str) -> str:
    """Returns the output of a program, which must succeed."""
    done = subprocess.run(
        command, cwd=cwd, env={**os.environ, **environment}, capture_output=True, text=True
    )
    assert done.returncode == 0, f"{command}: {done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns the folder of an installation that was moved after `make install`."""
    folder = tmp_path_factory.mktemp("c")
    run("make", "install", "prefix=/opt/pdmp", f"DESTDIR={folder / 'stage'}", cwd=ROOT)
    return (folder / "stage" / "opt" / "pdmp").rename(folder / "moved")


@pytest.fixture(scope="module", params=LANGUAGES)
def language(request: pytest.FixtureRequest) -> str:
    """Returns the name that CMake has for a language."""
    return str(request.param)


@pytest.fixture(scope="module")
def program(tree: Path, language: str, request: pytest.FixtureRequest) -> Path:
    """Returns a program linked with the shared library by name, beside its model."""
    compiler, standard, source, model = LANGUAGES[language]
    request.getfixturevalue(model).save(tree / "model.safetensors")
    run(
        *(compiler, standard, EXAMPLES / source, "-o", tree / "by_name"),
        *(f"-I{tree / 'include'}", f"-L{tree / 'lib'}", "-lpdmp", f"-Wl,-rpath,{tree / 'lib'}"),
    )
    return tree / "by_name"


@pytest.fixture(scope="module")
def motion(program: Path) -> str:
    """Returns the motion that the program prints."""
    lines = run(program, program.with_name("model.safetensors"))
    assert lines.count("\n") > 300
    return lines


@pytest.mark.parametrize("static", [False, True], ids=["shared", "static"])
def test_pkg_config_finds_the_moved_tree(
    tree: Path, motion: str, language: str, static: bool, tmp_path: Path
) -> None:
    """Programs built by its flags move as the one linked by name, to the bit."""
    compiler, standard, source, _ = LANGUAGES[language]
    path = str(tree / "lib" / "pkgconfig")
    flags = run(
        *("pkg-config", "--cflags", "--libs", *["--static"] * static, "pdmp"), PKG_CONFIG_PATH=path
    ).split()
    if static:
        flags = [str(tree / "lib" / "libpdmp.a") if f == "-lpdmp" else f for f in flags]
    built = tmp_path / "program"
    run(compiler, standard, EXAMPLES / source, *flags, f"-Wl,-rpath,{tree / 'lib'}", "-o", built)
    assert run(built, tree / "model.safetensors") == motion
    version = run("pkg-config", "--modversion", "pdmp", PKG_CONFIG_PATH=path)
    assert version.strip() == pdmp.__version__


@pytest.mark.parametrize("target", ["pdmp::pdmp", "pdmp::static"])
def test_cmake_finds_the_moved_tree(
    tree: Path, motion: str, language: str, target: str, tmp_path: Path
) -> None:
    """Programs built by `find_package(pdmp)` move as the one linked by name, to the bit."""
    write_project(tmp_path, language, target, abi())
    run(cmake(), "-S", tmp_path, "-B", tmp_path / "build", f"-DCMAKE_PREFIX_PATH={tree}")
    run(cmake(), "--build", tmp_path / "build")
    assert run(tmp_path / "build" / "program", tree / "model.safetensors") == motion


@pytest.mark.parametrize(("requested", "found"), [("0.1", True), ("0.1.0", True), ("0.2", False)])
def test_cmake_accepts_versions_of_the_same_abi(
    tree: Path, requested: str, found: bool, tmp_path: Path
) -> None:
    """Before 1.0, another minor version is another ABI."""
    write_project(tmp_path, "C", "pdmp::pdmp", requested)
    command = [cmake(), "-S", tmp_path, "-B", tmp_path / "build", f"-DCMAKE_PREFIX_PATH={tree}"]
    assert (subprocess.run(command, capture_output=True).returncode == 0) == found


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="names of libraries on Linux")
def test_programs_need_the_library_of_their_abi(tree: Path, program: Path) -> None:
    """The loader does not take a library of another ABI."""
    assert (tree / "lib" / "libpdmp.so").readlink() == Path(f"libpdmp.so.{abi()}")
    assert (tree / "lib" / f"libpdmp.so.{abi()}").readlink() == Path(
        f"libpdmp.so.{pdmp.__version__}"
    )
    assert f"libpdmp.so.{abi()}".encode() in program.read_bytes()


def abi() -> str:
    """Returns the version of the ABI, which before 1.0 changes with each minor version."""
    return pdmp.__version__.rpartition(".")[0]


def cmake() -> Path:
    """Returns the program of the package of the same name, or of the system."""
    beside = Path(sys.executable).with_name("cmake")
    found = str(beside) if beside.exists() else shutil.which("cmake")
    if found is None:
        pytest.skip("cmake not installed")
    return Path(found)


def write_project(folder: Path, language: str, target: str, requested: str) -> None:
    """Writes a CMake project of one program."""
    _, standard, source, _ = LANGUAGES[language]
    (folder / "CMakeLists.txt").write_text(
        f"""cmake_minimum_required(VERSION 3.20)
project(loop LANGUAGES {language})
find_package(pdmp {requested} REQUIRED)
add_executable(program {(EXAMPLES / source).as_posix()})
target_compile_options(program PRIVATE {standard})
target_link_libraries(program PRIVATE {target})
"""
    )
