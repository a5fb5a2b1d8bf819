"""Results, error messages and exit codes of the command line."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pdmp
from pdmp.cli import main
from pdmp.evaluation import PDMP, baselines
from synthetic import DT, loops, reaches

COMMANDS = ["fit", "cycles", "rollout", "evaluate", "info", "plot", "explore"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Returns a folder of five reaches with their bend in the index."""
    path = tmp_path / "recordings"
    (path / "demos").mkdir(parents=True)
    index = ["id,bend"]
    for m, demo in enumerate(reaches()):
        rows = np.column_stack([DT * np.arange(demo.n_samples), demo.position])
        np.savetxt(path / "demos" / f"{m}.csv", rows, "%.17g", ",", header="t,x,y", comments="")
        index.append(f"{m},{demo.context[0]}")
    (path / "index.csv").write_text("\n".join(index))
    return path


@pytest.fixture
def model_file(tmp_path: Path) -> Path:
    """Returns the file of a model of five reaches with two style parameters."""
    path = tmp_path / "model.safetensors"
    pdmp.fit(reaches(), n_styles=2).save(path)
    return path


def run(*arguments: object) -> int:
    """Runs the command line and return its exit code."""
    return main([str(argument) for argument in arguments])


def test_fit_learns_what_the_library_learns(folder: Path, tmp_path: Path) -> None:
    """The model file has the styles and contexts of the same fit in Python."""
    path = tmp_path / "model.safetensors"
    assert run("fit", folder, "--context", "bend", "--styles", 2, "-o", path) == 0
    model = pdmp.load(path)
    expected = pdmp.fit(pdmp.io.read([folder], context=["bend"]), n_styles=2)
    np.testing.assert_array_equal(model.styles, expected.styles)
    np.testing.assert_array_equal(model.contexts, expected.contexts)


def test_fit_takes_single_files(folder: Path, tmp_path: Path) -> None:
    """Each CSV file is one demonstration with the selected columns."""
    path = tmp_path / "model.safetensors"
    files = sorted((folder / "demos").glob("*.csv"))[:3]
    assert run("fit", *files, "--columns", "y", "--basis", "ngnet", "-o", path) == 0
    model = pdmp.load(path)
    assert (model.n_demos, list(model.names)) == (3, ["y"])


def test_fit_reads_time_by_its_name(folder: Path, tmp_path: Path) -> None:
    """With --time, the named column has the time stamps and is not a degree of freedom."""
    plain, named = tmp_path / "plain.safetensors", tmp_path / "named.safetensors"
    assert run("fit", folder, "-o", plain) == 0
    for file in (folder / "demos").glob("*.csv"):
        file.write_text(file.read_text().replace("t,x,y", "clock [s],x,y"))
    assert run("fit", folder, "-o", named) == 1
    assert run("fit", folder, "--time", "clock", "-o", named) == 0
    assert named.read_bytes() == plain.read_bytes()


def test_fit_and_plot_bridge_gaps_and_keep_units(folder: Path, tmp_path: Path) -> None:
    """With --max-gap, an empty field is interpolated; units are kept in model and table."""
    path, out = tmp_path / "model.safetensors", tmp_path / "out.csv"
    for file in (folder / "demos").glob("*.csv"):
        lines = file.read_text().replace("t,x,y", "t,x [m],y").splitlines()
        lines[20] = lines[20].rsplit(",", 1)[0] + ","
        file.write_text("\n".join(lines))
    assert run("fit", folder, "-o", path) == 1
    assert run("fit", folder, "--max-gap", 0.05, "-o", path) == 0
    assert run("rollout", path, "-o", out) == 0
    assert out.read_text(encoding="utf-8").startswith("t,x [m],y,x_velocity [m/s],")
    assert run("plot", path, folder, "--max-gap", 0.05, "-o", tmp_path / "figures") == 0


def test_fit_learns_rhythmic_movements(tmp_path: Path) -> None:
    """The option --kind reaches the fit."""
    archive, path = tmp_path / "loops.npz", tmp_path / "model.safetensors"
    np.savez(archive, *[demo.position for demo in loops()])
    assert run("fit", archive, "--kind", "rhythmic", "--dt", DT, "-o", path) == 0
    assert pdmp.load(path).kind == "rhythmic"


def test_fit_reports_its_progress_on_standard_error(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Progress is on standard error; standard output has the result alone."""
    run("fit", folder, "-o", tmp_path / "model.safetensors")
    captured = capsys.readouterr()
    assert captured.err
    assert len(captured.out.splitlines()) == 1


def test_rollout_writes_the_movement(model_file: Path, tmp_path: Path) -> None:
    """The CSV file equals the rollout of the library bit for bit."""
    path = tmp_path / "out.csv"
    code = run("rollout", model_file, "--style", 0.1, -0.2, "--goal", 1, 0.5, "-o", path)
    assert code == 0
    model = pdmp.load(model_file)
    expected = model.rollout(style=[0.1, -0.2], goal=[1, 0.5])
    made = pdmp.io.read_csv(path, columns=model.names)
    np.testing.assert_array_equal(made.position, expected.position)


def test_rollout_passes_its_goal_with_the_given_velocity(model_file: Path, tmp_path: Path) -> None:
    """--velocity is the start velocity, --goal-velocity that at the end."""
    path = tmp_path / "out.csv"
    ends = "--velocity", 0.2, 0, "--goal-velocity", -1, 0.5
    assert run("rollout", model_file, *ends, "-o", path) == 0
    model = pdmp.load(model_file)
    expected = model.rollout(velocity=[0.2, 0.0], goal_velocity=[-1.0, 0.5])
    made = pdmp.io.read_csv(path, columns=model.names)
    np.testing.assert_array_equal(made.position, expected.position)
    assert not np.allclose(made.position, model.rollout(velocity=[0.2, 0.0]).position, atol=1e-3)


def test_rollout_reproduces_a_demonstration(model_file: Path, tmp_path: Path) -> None:
    """With --demo, style, goal, start and duration are those of the demonstration."""
    path = tmp_path / "out.csv"
    assert run("rollout", model_file, "--demo", 4, "--dt", DT, "-o", path) == 0
    made = pdmp.io.read_csv(path, columns=["x", "y"])
    np.testing.assert_allclose(made.position[-1], reaches()[4].position[-1], atol=0.02)
    assert made.n_samples == reaches()[4].n_samples


def test_rollout_of_a_context_is_its_prediction(model_file: Path, tmp_path: Path) -> None:
    """With --context, the movement is the one that the library predicts."""
    path = tmp_path / "out.csv"
    assert run("rollout", model_file, "--context", 0.15, "-o", path) == 0
    expected = pdmp.load(model_file).rollout(context=[0.15])
    made = pdmp.io.read_csv(path, columns=["x", "y"])
    np.testing.assert_array_equal(made.position, expected.position)


def test_warped_models_are_described_and_reproduce_demonstrations(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """--alignment and --styles auto select the library's fit; --tau replaces segment durations."""
    path, out = tmp_path / "model.safetensors", tmp_path / "out.csv"
    options = ("--context", "bend", "--alignment", "warp", "--styles", "auto")
    assert run("fit", folder, *options, "-o", path) == 0
    recordings = pdmp.io.read([folder], context=["bend"])
    expected = pdmp.fit(recordings, alignment="warp", n_styles="auto")
    np.testing.assert_array_equal(pdmp.load(path).styles, expected.styles)
    # Without contexts nothing speaks against a warp.
    assert run("fit", folder, "--alignment", "warp", "-o", path) == 0
    expected = pdmp.fit(pdmp.io.read([folder]), alignment="warp")
    model = pdmp.load(path)
    np.testing.assert_array_equal(model.styles, expected.styles)
    assert run("info", path) == 0
    assert re.search(r"segments +8", capsys.readouterr().out)
    assert run("rollout", path, "--demo", 2, "-o", out) == 0
    made = model.rollout(model.conditions(2))
    np.testing.assert_array_equal(pdmp.io.read_csv(out, columns=["x", "y"]).position, made.position)
    assert run("rollout", path, "--demo", 2, "--tau", 2 * model.tau, "-o", out) == 0
    assert pdmp.io.read_csv(out).time[-1] == pytest.approx(2 * model.durations[model.nominal], 0.02)


def test_evaluate_fills_gaps_up_to_max_gap(folder: Path) -> None:
    """A missing field is rejected with its location, or interpolated up to a given length."""
    path = folder / "demos" / "2.csv"
    lines = path.read_text().split("\n")
    lines[30] = lines[30].rsplit(",", 1)[0] + ","
    path.write_text("\n".join(lines))
    given = ("evaluate", folder, "--context", "bend", "--styles", 2)
    assert run(*given) != 0
    assert run(*given, "--max-gap", 2.5 * DT) == 0


def test_evaluate_prints_the_results_of_the_library(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The table is printed and, with --output, written with two figures."""
    out = tmp_path / "evaluation"
    assert run("evaluate", folder, "--context", "bend", "--styles", 2, "-o", out) == 0
    written = {path.name for path in out.iterdir()}
    assert written == {"evaluation.md", "held_out.png", "prediction_error.png"}
    recordings = pdmp.io.read([folder], context=["bend"])
    predictors = baselines() | {"PDMP": PDMP(n_styles=2)}
    assert repr(pdmp.evaluate(recordings, predictors=predictors)) in capsys.readouterr().out


def test_info_prints_kind_names_and_styles(
    model_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The main properties of a model are printed, one per line."""
    assert run("info", model_file) == 0
    text = capsys.readouterr().out
    for expected in (
        r"kind +discrete",
        r"DoFs +2: x \[m\], y \[m\]",
        r"styles +2; truncation error .*%",
        r"demonstrations +5",
    ):
        assert re.search(expected, text)


def test_plot_writes_every_figure(model_file: Path, folder: Path, tmp_path: Path) -> None:
    """Demonstrations are drawn if given; a discrete model has no phase portrait."""
    figures = tmp_path / "figures"
    assert run("plot", model_file, folder, "-o", figures) == 0
    written = {path.name for path in figures.iterdir()}
    assert written == {"demonstrations.png", "fan.png", "singular_values.png", "styles.png"}


def test_plot_draws_the_phase_portrait_of_a_rhythmic_model(tmp_path: Path) -> None:
    """A rhythmic model has its phase portrait drawn."""
    path = tmp_path / "model.safetensors"
    pdmp.fit(loops(), kind="rhythmic").save(path)
    assert run("plot", path, "-o", tmp_path) == 0
    assert (tmp_path / "phase_portrait.png").exists()


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The help of each command exits with 0 and has an example."""
    with pytest.raises(SystemExit, match="0"):
        run(command, "--help")
    assert f"example: pdmp {command}" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["dance"],
        ["fit"],
        ["fit", "f", "--styles", "many", "-o", "m"],
        ["fit", "f", "--smoothing", "much", "-o", "m"],
        ["rollout", "m", "--style", "1", "--demo", "0"],
    ],
)
def test_wrong_usage_exits_with_2(arguments: list[str]) -> None:
    """Usage errors have the exit code 2."""
    with pytest.raises(SystemExit, match="2"):
        run(*arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["info", "none.safetensors"], "none.safetensors"),
        (["fit", "none.csv", "-o", "m"], "none.csv: No such file"),
        (["rollout", "{model}", "--style", "1", "-o", "o"], "--style has length 1, expected 2"),
        (["rollout", "{model}", "--goal", "1", "-o", "o"], "--goal has length 1, expected 2"),
        (["rollout", "{model}", "--goal-velocity", "1", "-o", "o"], "--goal-velocity has length 1"),
        (["rollout", "{model}", "--velocity", "1", "-o", "o"], "--velocity has length 1, expec"),
        (["rollout", "{model}", "--tau", "-1", "-o", "o"], "--tau = -1: must be positive"),
        (["rollout", "{model}", "--demo", "9", "-o", "o"], "--demo = 9: must lie between 0 and 4"),
        (
            ["rollout", "{model}", "--demo", "-1", "-o", "o"],
            "--demo = -1: must lie between",
        ),
        (["fit", "{folder}", "--styles", "9", "-o", "m"], "--styles = 9: must lie between 1 and 5"),
        (
            ["fit", "{folder}", "--styles", "1", "--singular-value-share", "0.5", "-o", "m"],
            "--styles and --singular-value-share: pass one of them",
        ),
        (["fit", "{folder}", "--smoothing", "-3", "-o", "m"], "--smoothing = -3: must be positive"),
        (["fit", "{folder}", "--period", "1", "-o", "m"], "--period does not apply to a discrete"),
        (["fit", "{folder}", "--max-gap", "-1", "-o", "m"], "--max-gap = -1: must not be negative"),
        (["info", "{index}"], "usable file"),
    ],
)
def test_errors_are_one_line_and_exit_with_1(
    model_file: Path,
    folder: Path,
    arguments: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Errors are reported in one line on standard error, without a traceback."""
    paths = {"model": model_file, "folder": folder, "index": folder / "index.csv"}
    assert run(*(argument.format(**paths) for argument in arguments)) == 1
    captured = capsys.readouterr()
    assert re.fullmatch(rf"pdmp: error: .*{message}.*\n", captured.err)
    assert captured.out == ""


def test_interruption_exits_with_130_and_leaves_no_file(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C during a fit ends it without a model file."""

    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(pdmp, "fit", interrupt)
    path = tmp_path / "model.safetensors"
    assert run("fit", folder, "-o", path) == 130
    assert not path.exists()


def test_closed_pipe_causes_no_traceback(model_file: Path) -> None:
    """Output to a closed pipe ends without a traceback."""
    command = [sys.executable, "-m", "pdmp", "info", str(model_file)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.close()
    with process.stderr as errors:
        assert errors.read() == b""
    assert process.wait() == 1


def test_negative_exponents_are_numbers(model_file: Path, tmp_path: Path) -> None:
    """-1e-3, as models print it, is parsed as a number and not as an option."""
    out = tmp_path / "out.csv"
    assert run("rollout", model_file, "--goal", "-1e-3", "2", "-o", out) == 0
    end = pdmp.io.read_csv(out, columns=["x", "y"]).position[-1]
    np.testing.assert_allclose(end, [-1e-3, 2], atol=0.2)


@pytest.mark.parametrize("command", ["fit", "rollout", "plot", "evaluate"])
def test_missing_folder_is_reported_before_the_work(
    folder: Path,
    model_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    command: str,
) -> None:
    """An output in a folder that does not exist is rejected; no folder is created."""
    source = folder if command in ("fit", "evaluate") else model_file
    assert run(command, source, "-o", tmp_path / "nowhere" / "output") == 1
    reported = capsys.readouterr().err
    assert reported == f"pdmp: error: {tmp_path / 'nowhere'}: no such folder; create it first\n"
    assert not (tmp_path / "nowhere").exists()


def test_numbers_of_recordings_are_reported(
    folder: Path, model_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Figures need all demonstrations of a fit."""
    assert run("plot", model_file, folder / "demos" / "0.csv", "-o", tmp_path / "figures") == 1
    assert "1 recording given, expected 5: one per demonstration" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--kind", "rhythmic", "--transport", "learnt"], "--transport does not apply to"),
        (["--kind", "rhythmic"], "demo 0: --period is missing: pass it in seconds"),
        (["--styles", "auto"], "--styles needs contexts for cross-validation: pass --context, or"),
        (["--styles", "9"], "--styles = 9: must lie between 1 and 5"),
    ],
)
def test_messages_name_the_options_of_the_command(
    folder: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    """Arguments that an error reports or recommends have the form of options."""
    assert run("fit", folder, "-o", tmp_path / "m", *arguments) == 1
    assert message in capsys.readouterr().err


def test_recommended_conditions_are_options(
    model_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An anchor of a discrete model is rejected with the option of its goal."""
    assert run("rollout", model_file, "--anchor", 1, 2, "-o", tmp_path / "out.csv") == 1
    reported = capsys.readouterr().err
    assert "--anchor does not apply to a discrete primitive" in reported
    assert "set --goal" in reported


def test_arguments_without_an_option_are_those_of_python(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A remedy that no option of the command has is marked."""
    noise = np.random.default_rng(3).normal(size=(400, 2))
    rows = np.column_stack([0.01 * np.arange(400), noise])
    np.savetxt(tmp_path / "noise.csv", rows, delimiter=",", header="t,x,y", comments="")
    assert run("cycles", tmp_path / "noise.csv", "-o", tmp_path / "model") == 1
    assert "give the onset of each cycle (onsets= in Python)" in capsys.readouterr().err


@pytest.mark.filterwarnings("default::UserWarning")
def test_extrapolated_contexts_are_reported(
    model_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A movement for a context far outside the demonstrated ones is written, with a warning."""
    out = tmp_path / "out.csv"
    assert run("rollout", model_file, "--context", 0.0, "-o", out) == 0
    assert capsys.readouterr().err == ""
    assert run("rollout", model_file, "--context", 1.2, "-o", out) == 0
    reported = capsys.readouterr().err
    assert "pdmp: warning: --context[0] = 1.2 lies outside the demonstrated range" in reported


def test_errors_name_options(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Errors name the options of the command instead of arguments of Python."""
    assert run("evaluate", folder) == 1
    assert "pass --context" in capsys.readouterr().err
    assert run("fit", folder, "-o", tmp_path) == 1
    assert "a folder" in capsys.readouterr().err
