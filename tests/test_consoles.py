"""Output to a terminal has no control characters, and suits every encoding."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pdmp
from pdmp import Demonstration
from pdmp.cli import main

# Clears the screen, reverses the direction of writing, breaks the line.
HOSTILE = "\x1b[2J\u202e\r\n\x07"
S = np.linspace(0, 1, 61)[:, None]


def hostile() -> list[Demonstration]:
    """Returns demonstrations whose names, units and labels contain control characters."""
    return [
        Demonstration(
            np.hstack([k * S, S * (k - S)]),
            dt=0.02,
            names=["x" + HOSTILE, "é"],
            units=["m\x1b\u202eτ", ""],
            context=[k, "left" + HOSTILE],
        )
        for k in (1.0, 2.0, 3.0)
    ]


@pytest.fixture
def model_file(tmp_path: Path) -> Path:
    """Returns the file of a model of these demonstrations."""
    pdmp.fit(hostile()).save(tmp_path / "model.safetensors")
    return tmp_path / "model.safetensors"


def assert_harmless(text: str) -> None:
    """Asserts that a text has no control characters except line breaks."""
    assert all(c.isprintable() or c == "\n" for c in text), ascii(text)


def test_reprs_are_harmless() -> None:
    """The repr of an object is one line of printable characters, most of them ASCII."""
    model = pdmp.fit(hostile())
    context = [1.5, "left" + HOSTILE]
    objects = [model, model.map, model.predict(context), model.rollout(), model.controller()]
    objects.append(pdmp.GP().regress(S[:, 0], S))
    for found in (*objects, hostile()[0]):
        for text in (repr(found), str(found)):
            assert_harmless(text)
            assert "\n" not in text
            assert text.isascii()


def test_tables_are_harmless() -> None:
    """Names of predictors are escaped in the tables of an evaluation, which are ASCII."""
    demonstrations = [Demonstration(k * S, dt=0.02, context=[k]) for k in range(1, 6)]
    predictors = {"mine" + HOSTILE: pdmp.evaluation.PDMP()}
    found = pdmp.evaluate(demonstrations, predictors=predictors)
    assert_harmless(repr(found))
    assert_harmless(found.markdown())
    assert repr(found).isascii()


def test_errors_are_harmless(tmp_path: Path) -> None:
    """Errors quote names, labels and fields of files with their control characters escaped."""
    model, path = pdmp.fit(hostile()), tmp_path / "a.csv"
    index, labelled = tmp_path / "index.csv", [[f"l{k}{HOSTILE}"] for k in range(3)]

    def table(text: str, **options: object) -> None:
        path.write_text(text, encoding="utf-8")
        pdmp.io.read_csv(path, **options)

    def folder(text: str) -> None:
        index.write_text(text, encoding="utf-8")
        pdmp.io.read_folder(tmp_path)

    rows = "".join(f"{k / 10},{k}\n" for k in range(9))
    calls = (
        lambda: model.predict([1.0, "right" + HOSTILE]),
        lambda: pdmp.fit(hostile(), kind="a" + HOSTILE),
        lambda: pdmp.load(tmp_path / HOSTILE),
        lambda: Demonstration([["a" + HOSTILE, 1.0]] * 9, dt=0.1),
        lambda: Demonstration(np.array([["a" + HOSTILE, 1.0]] * 9, object), dt=0.1),
        lambda: pdmp.evaluate([k * S for k in (1, 2, 3)], dt=0.1, contexts=labelled),
        lambda: pdmp.Conditions(**{"a" + HOSTILE: 1.0}),
        lambda: pdmp.io.write_csv(path, model.rollout(), ["1", "a" + HOSTILE]),
        lambda: table("t,x\n0,\x1b[2J\n" + rows),
        lambda: table('t,"x\x1b[2J\n\u202e"\n0,z\n' + rows),
        lambda: table("t,x\n" + rows, columns=["y" + HOSTILE]),
        lambda: table("t [\x1b[2J],x\n" + rows),
        lambda: folder("id\n../\x1b[2J\n"),
        lambda: pdmp.io.read(tmp_path / HOSTILE),
    )
    for call in calls:
        with pytest.raises((ValueError, TypeError, OSError)) as raised:
            call()
        assert_harmless(str(raised.value))
        assert "\n" not in str(raised.value)


@pytest.mark.parametrize("encoding", ["cp932", "cp1251", "ascii", "utf-8"])
def test_commands_can_print_to_any_console(model_file: Path, tmp_path: Path, encoding: str) -> None:
    """Characters outside the console's encoding are replaced; control characters are escaped."""
    script = "import pdmp, sys; print(pdmp.load(sys.argv[1]))"
    table = tmp_path / "é\x1b.csv"
    pdmp.load(model_file).rollout().to_csv(table)
    commands = (
        [sys.executable, "-c", script, model_file],
        *(
            [sys.executable, "-m", "pdmp", *command]
            for command in (
                ["info", model_file],
                ["rollout", model_file, "-o", tmp_path / "aé\x1b"],
                ["fit", table, table, "--smoothing", "5", "-o", tmp_path / "bé\x1b"],
                ["fit", "--help"],
            )
        ),
    )
    for command in commands:
        environment = {**os.environ, "PYTHONIOENCODING": encoding}
        done = subprocess.run(command, capture_output=True, env=environment)
        assert done.returncode == 0, done.stderr
        for text in (done.stdout, done.stderr):
            assert_harmless(text.decode(encoding).replace(os.linesep, "\n"))
    failed = subprocess.run(
        [sys.executable, "-m", "pdmp", "info", "é\x1b"], capture_output=True, env=environment
    )
    assert failed.returncode == 1
    assert_harmless(failed.stderr.decode(encoding).replace(os.linesep, "\n"))


def test_info_prints_names_and_labels_in_one_line(
    model_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A line break in a name is escaped."""
    assert main(["info", str(model_file)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert all(re.match(r"[\w ]{16}\S", line) for line in lines)
    assert any(r"x\x1b[2J\u202e\r\n\x07 [m\x1b\u202eτ], é" in line for line in lines)


@pytest.mark.parametrize(
    "arguments",
    [
        ["plot", "m", "-o", "-"],
        ["evaluate", "a", "-o", "-"],
    ],
)
def test_a_dash_is_rejected_as_a_folder(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """The path - is rejected for figures: it is a stream, not a folder."""
    with pytest.raises(SystemExit, match="2"):
        main(arguments)
    assert "- is not a file: name one, or write ./-" in capsys.readouterr().err
    assert not Path("-").exists()


def test_warnings_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Warnings of the library are printed in one line on standard error."""
    path = tmp_path / "a.csv"
    path.write_text("t,x\n" + "".join(f"{1_700_000_000_000 + 10 * k},{k}\n" for k in range(20)))
    assert main(["fit", str(path), "-o", str(tmp_path / "m")]) == 0
    (warning,) = [line for line in capsys.readouterr().err.splitlines() if "warning" in line]
    assert re.match(r"pdmp: warning: .*a\.csv, column 't': time stamps are read as ms", warning)


def test_values_of_the_user_are_quoted_as_given(
    model_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A value that reads like an argument keeps its text, while arguments become options."""
    value = "style=x: goal = 3"
    arguments = ["rollout", str(model_file), "--context", "2", value, "-o", str(tmp_path / "r.csv")]
    assert main(arguments) == 1
    error = capsys.readouterr().err
    assert f'"{value}"' in error or f"'{value}'" in error
    assert "--context" in error
