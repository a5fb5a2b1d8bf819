"""The command line at the first try: files of others, streams, cycles, and help with formats."""

import io
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas
import pytest

import pdmp
import recorded
from pdmp.cli import main
from synthetic import DT, loops, reaches


def run(*arguments: object) -> int:
    """Runs the command line and returns its exit code."""
    return main([str(argument) for argument in arguments])


def piped(data: bytes, *arguments: object) -> subprocess.CompletedProcess[bytes]:
    """Runs the command in a process with these bytes on standard input."""
    command = [sys.executable, "-m", "pdmp", *map(str, arguments)]
    return subprocess.run(command, input=data, capture_output=True, check=False)


def walk(seed: int = 0, n_cycles: float = 8.3) -> pandas.DataFrame:
    """Returns a noisy raw walk of hip and knee."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, 1.1 * n_cycles, 0.01)
    phase = 2 * np.pi * time / 1.1
    knee = 0.45 - 0.25 * np.cos(phase - 0.6) - 0.3 * np.cos(2 * phase - 1)
    positions = np.column_stack([0.15 + 0.4 * np.cos(phase), knee])
    positions += 0.01 * rng.standard_normal(positions.shape)
    return pandas.DataFrame(positions, columns=["hip [rad]", "knee [rad]"], index=time)


def reach_frames() -> list[pandas.DataFrame]:
    """Returns reaches as data frames with a column of time stamps."""
    return [
        pandas.DataFrame(
            {
                "t": DT * np.arange(demo.n_samples),
                "x": demo.position[:, 0],
                "y": demo.position[:, 1],
            }
        )
        for demo in reaches()
    ]


def test_cycles_fits_a_raw_walk(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The model is that of the library's cycles; the cycles are counted in the output."""
    walk().to_csv(tmp_path / "walk.csv")
    path = tmp_path / "walk.safetensors"
    assert run("cycles", tmp_path / "walk.csv", "-o", path) == 0
    assert "Cycles: 8 of 1.0" in capsys.readouterr().out
    model = pdmp.load(path)
    cycles = pdmp.preprocessing.cycles(pdmp.io.read(tmp_path / "walk.csv"))
    expected = pdmp.fit(cycles, kind="rhythmic")
    np.testing.assert_array_equal(model.styles, expected.styles)
    assert (model.kind, model.units) == ("rhythmic", ["rad", "rad"])
    assert 2 * np.pi * model.tau == pytest.approx(1.1, rel=0.02)


def test_cycles_keep_the_contexts_of_their_recordings(tmp_path: Path) -> None:
    """Each cycle has the context of its recording, by name."""
    (tmp_path / "demos").mkdir()
    for k in range(3):
        walk(k).to_csv(tmp_path / "demos" / f"{k}.csv")
    (tmp_path / "index.csv").write_text("id,speed\n0,0.8\n1,1.2\n2,1.6\n")
    path = tmp_path / "walk.safetensors"
    assert run("cycles", tmp_path, "--context", "speed", "--average", "-o", path) == 0
    model = pdmp.load(path)
    assert (model.context_names, model.n_demos) == (["speed"], 3)


def test_the_first_try_succeeds(tmp_path: Path) -> None:
    """Tables of pandas, a folder of them and files of motion capture are fitted as they are."""
    folder, path = tmp_path / "tables", tmp_path / "m.safetensors"
    folder.mkdir()
    for k, frame in enumerate(reach_frames()):
        frame.to_csv(folder / f"{k}.csv")
    assert run("fit", folder, "-o", path) == 0
    assert run("fit", *sorted(folder.glob("*.csv")), "-o", path) == 0
    assert pdmp.load(path).names == ["x", "y"]
    for k in range(3):
        recorded.write_c3d(tmp_path / f"{k}.c3d", recorded.path_of(k, 6), ["LASI", "RASI"])
    assert run("fit", *sorted(tmp_path.glob("*.c3d")), "-o", path) == 0
    data = recorded.write_lerobot(tmp_path / "set", "v3.0", [recorded.path_of(k) for k in range(4)])
    assert run("fit", data, "--context", "task", "-o", path) == 0
    assert pdmp.load(path).context_names == ["task"]


def test_one_error_leads_from_a_table_without_time_to_a_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The error of a table without time names the option that helps."""
    for k, frame in enumerate(reach_frames()):
        frame.drop(columns="t").to_csv(tmp_path / f"{k}.csv")
    path = tmp_path / "m.safetensors"
    assert run("fit", tmp_path, "-o", path) == 1
    assert "pass --dt" in capsys.readouterr().err
    assert run("fit", tmp_path, "--dt", DT, "-o", path) == 0


def test_contexts_keep_their_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Columns of index.csv name the contexts of the model, its description and rollouts."""
    (tmp_path / "demos").mkdir()
    lines = ["id,bend,hand"]
    for k, (demo, frame) in enumerate(zip(reaches(), reach_frames(), strict=True)):
        frame.to_csv(tmp_path / "demos" / f"{k}.csv")
        lines.append(f"{k},{demo.context[0]},{'left' if k % 2 else 'right'}")
    (tmp_path / "index.csv").write_text("\n".join(lines))
    path, out = tmp_path / "m.safetensors", tmp_path / "out.csv"
    assert run("fit", tmp_path, "--context", "bend", "hand", "-o", path) == 0
    assert run("info", path) == 0
    assert "hand left right" in capsys.readouterr().out
    assert run("rollout", path, "--context", "hand=left", "bend=0.1", "-o", out) == 0
    by_name = out.read_bytes()
    assert run("rollout", path, "--context", 0.1, "left", "-o", out) == 0
    assert out.read_bytes() == by_name
    assert run("rollout", path, "--context", "foot=left", "bend=0.1", "-o", out) == 1
    assert "foot" in capsys.readouterr().err


def test_models_and_movements_are_piped(tmp_path: Path) -> None:
    """A chain of processes from a table to a movement gives what the files give."""
    walk().to_csv(tmp_path / "walk.csv")
    fitted = piped((tmp_path / "walk.csv").read_bytes(), "cycles", "-", "-o", "-")
    assert fitted.returncode == 0 and b"standard output: " in fitted.stderr
    path = tmp_path / "walk.safetensors"
    assert run("cycles", tmp_path / "walk.csv", "-o", path) == 0
    assert fitted.stdout == path.read_bytes()
    moved = piped(fitted.stdout, "rollout", "-", "--dt", 0.02, "-o", "-")
    assert run("rollout", path, "--dt", 0.02, "-o", tmp_path / "out.csv") == 0
    assert moved.returncode == 0 and moved.stdout == (tmp_path / "out.csv").read_bytes()
    described = piped(fitted.stdout, "info", "-")
    assert described.stdout.startswith(b"kind            rhythmic")


def test_standard_input_has_any_format_and_a_name(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The format is found in the first bytes; errors are about standard input."""
    archive = io.BytesIO()
    np.savez(archive, *[demo.position for demo in reaches()])

    def supply(data: bytes) -> None:
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))

    supply(archive.getvalue())
    assert run("fit", "-", "--dt", DT, "-o", tmp_path / "m") == 0
    supply(b"t,x\n0,1\n0.1,z\n")
    assert run("fit", "-", "-o", tmp_path / "m") == 1
    error = capsys.readouterr().err
    assert "standard input, line 3, column 'x': 'z' is not a number" in error
    assert "/" not in error.splitlines()[-1]
    assert run("plot", "-", "-", "-o", tmp_path / "figures") == 1
    assert "standard input can be read once" in capsys.readouterr().err


def test_each_recording_may_have_its_own_period(tmp_path: Path) -> None:
    """The option --period takes one value, or one of each recording."""
    cycles = loops()
    archive, path = tmp_path / "loops.npz", tmp_path / "m.safetensors"
    arrays = {}
    for m, demo in enumerate(cycles):
        arrays |= {f"{m}": demo.position, f"{m}.t": DT * np.arange(demo.n_samples)}
    np.savez(archive, **arrays)
    periods = [DT * demo.n_samples * (1 + 0.01 * m) for m, demo in enumerate(cycles)]
    rhythmic = ("fit", archive, "--kind", "rhythmic", "-o", path, "--period")
    assert run(*rhythmic, *periods) == 0
    np.testing.assert_allclose(pdmp.load(path).durations, periods)
    assert run(*rhythmic, 9.0) == 0
    np.testing.assert_allclose(pdmp.load(path).durations, 9.0)


def test_plot_reads_the_columns_of_the_model(tmp_path: Path) -> None:
    """Columns of the recordings that the model lacks are left out without --columns."""
    folder, path = tmp_path / "tables", tmp_path / "m.safetensors"
    folder.mkdir()
    for k, frame in enumerate(reach_frames()):
        frame.assign(force=frame["x"] * 3).to_csv(folder / f"{k}.csv")
    assert run("fit", folder, "--columns", "y", "x", "-o", path) == 0
    assert run("plot", path, folder, "-o", tmp_path / "figures") == 0
    assert (tmp_path / "figures" / "demonstrations.png").exists()


@pytest.mark.parametrize("average", [[], ["--average"]])
def test_plot_cuts_the_recordings_of_cycles(tmp_path: Path, average: list[str]) -> None:
    """The raw recordings of a rhythmic model are drawn as the cycles it was fitted to."""
    folder, path = tmp_path / "walks", tmp_path / "m.safetensors"
    folder.mkdir()
    for k in range(3):
        walk(k).to_csv(folder / f"{k}.csv")
    assert run("cycles", folder, *average, "-o", path) == 0
    assert run("plot", path, folder, "-o", tmp_path / "figures") == 0
    assert (tmp_path / "figures" / "demonstrations.png").exists()


@pytest.mark.parametrize("command", ["fit", "cycles", "evaluate", "plot"])
def test_help_shows_the_formats(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The help of commands that read recordings has a CSV file and a folder."""
    with pytest.raises(SystemExit, match="0"):
        run(command, "--help")
    text = capsys.readouterr().out
    assert "t,hip [rad],knee [rad]" in text and "index.csv" in text and "standard input" in text
