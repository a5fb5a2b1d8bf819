"""Long calls report progress, can be interrupted, and leave no incomplete file."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pdmp
from synthetic import reaches


def test_progress_is_reported_in_order() -> None:
    """The four stages are reported in order, each with rising fractions within [0, 1]."""
    reported: list[tuple[str, float]] = []
    pdmp.fit(reaches(), progress=lambda stage, share: reported.append((stage, share)))
    stages = list(dict.fromkeys(stage for stage, _ in reported))
    assert stages == ["targets", "factorise", "regress", "compile"]
    assert reported == sorted(reported, key=lambda entry: (stages.index(entry[0]), entry[1]))
    assert all(0 <= share <= 1 for _, share in reported)
    assert sum(stage == "regress" for stage, _ in reported) > 10


@pytest.mark.parametrize("stage", ["targets", "factorise", "regress", "compile"])
def test_exception_in_progress_ends_the_fit(stage: str) -> None:
    """An exception of the callback propagates and ends the fit."""
    reported = []

    def stop(now: str, _: float) -> None:
        reported.append(now)
        if now == stage:
            raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        pdmp.fit(reaches(), progress=stop)
    assert reported.count(stage) == 1


def test_interrupt_in_progress_ends_the_fit() -> None:
    """Ctrl-C in the callback raises KeyboardInterrupt."""
    # A process in the background of a shell ignores the signal.
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            pdmp.fit(reaches(), progress=lambda *_: signal.raise_signal(signal.SIGINT))
    finally:
        signal.signal(signal.SIGINT, handler)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="this system has no timer signals")
def test_signal_ends_a_long_fit() -> None:
    """A signal handler runs during a fit without a callback, and its exception ends the fit."""

    class Late(Exception):
        pass

    def ring(*_: object) -> None:
        raise Late

    s = np.linspace(0, 1, 40_000)
    demos = [np.sin(np.outer(s, np.arange(1, 8)) + m) for m in range(7)]
    before = signal.signal(signal.SIGALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with pytest.raises(Late):
            pdmp.fit(demos, dt=1e-4, n_styles=7)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def test_failed_save_leaves_nothing(tmp_path: Path) -> None:
    """Saving over a folder fails without leaving a temporary file."""
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError, match="folder"):
        pdmp.fit(reaches()).save(tmp_path / "folder")
    assert os.listdir(tmp_path) == ["folder"]
    assert os.listdir(tmp_path / "folder") == []


@pytest.mark.skipif(sys.platform == "win32", reason="this system has no limit on file sizes")
def test_save_that_runs_out_of_space_leaves_the_older_file(tmp_path: Path) -> None:
    """An incomplete write raises OSError, and the former file is unchanged."""
    path = tmp_path / "model"
    model = pdmp.fit(reaches(), basis="ngnet")
    model.save(path)
    saved = path.read_bytes()
    code = f"""
import resource, pdmp
model = pdmp.load({str(path)!r})
resource.setrlimit(resource.RLIMIT_FSIZE, ({len(saved) // 2}, {len(saved) // 2}))
try:
    model.save({str(path)!r})
except OSError as error:
    print("rejected")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "rejected\n", done.stderr
    assert path.read_bytes() == saved
    assert os.listdir(tmp_path) == ["model"]
