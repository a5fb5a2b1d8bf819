"""Recordings of people are read, learnt, reproduced, and predicted from contexts."""

import csv
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp import Demonstration
from pdmp._native import inspected
from pdmp.io import read_folder


def folder(name: str) -> Path:
    """Returns the folder of a set of recordings, or skips the test without it."""
    try:
        return pdmp.datasets.folder(name)
    except FileNotFoundError as reason:
        pytest.skip(str(reason))


def recordings(name: str, step: int, **options: Any) -> list[Demonstration]:
    """Returns every `step`-th demonstration of a set."""
    return list(read_folder(folder(name), **options).values())[::step]


def worst_error(model: pdmp.Model, demos: list[Demonstration]) -> float:
    """Returns the largest RMSE over range of a reproduction, of any demonstration."""
    errors = []
    for m, demo in enumerate(demos):
        steps = demo.n_samples - (model.kind == "discrete")
        made = model.rollout(model.conditions(m), dt=model.durations[m] / steps)
        difference = made.position[: demo.n_samples] - demo.position
        errors.append(np.sqrt(np.mean(difference**2)) / np.ptp(demo.position, axis=0).max())
    return max(errors)


def assert_finite(trajectory: pdmp.Trajectory) -> None:
    """Asserts that a movement is finite."""
    for name in ("position", "velocity", "acceleration"):
        assert np.isfinite(getattr(trajectory, name)).all()


ARM = ["r_sh1", "r_sh2", "r_sh3", "r_elb"]


def raised_hands() -> list[Demonstration]:
    """Returns movements of a four-joint arm that raises its hand to several heights."""
    return recordings("raise_hand_bandai", 8, columns=ARM, context=["hold_height_m"])


def test_raised_hands_are_reproduced() -> None:
    """With J = M, arm movements at 30 Hz are reproduced to 1e-3 of their range."""
    demos = raised_hands()
    model = pdmp.fit(demos, n_styles=len(demos))
    assert model.names == ARM
    assert worst_error(model, demos) <= 1e-3


def test_raised_hands_are_predicted_from_their_height() -> None:
    """Predicted movements for heights between and beyond the demonstrated ones are finite."""
    model = pdmp.fit(raised_hands())
    for height in (1.0, 1.4, 1.8):
        assert_finite(model.rollout(context=[height]))
        assert 0.3 < model.predict([height]).duration < 10


def test_noisy_hands_can_be_smoothed() -> None:
    """With automatic smoothing the reproductions stay within a hundredth of the range."""
    demos = raised_hands()
    model = pdmp.fit(demos, n_styles=len(demos), smoothing="auto")
    assert worst_error(model, demos) <= 1e-2


def walking_forces() -> list[Demonstration]:
    """Returns forces of the first walker's stances at many speeds."""
    return recordings("walking_force_speed", 1, context=["speed_m_s"])[:60]


@pytest.mark.parametrize("basis", ["gp", "ngnet"])
def test_walking_forces_are_reproduced(basis: Any) -> None:
    """With J = M, forces that jump within a sample are reproduced to 5 % of their range."""
    demos = walking_forces()[::5]
    model = pdmp.fit(demos, n_styles=len(demos), basis=basis)
    assert worst_error(model, demos) <= 0.05


@pytest.mark.parametrize("basis", ["gp", "ngnet"])
def test_unseen_speeds_are_predicted_better_than_by_the_mean(basis: Any) -> None:
    """Held-out stances are closer to the prediction for their speed than to the mean."""
    demos = walking_forces()
    seen, unseen = demos[::2], demos[1::2]
    model = pdmp.fit(seen, n_styles=3, basis=basis)
    mean = np.mean([demo.position for demo in seen], axis=0)
    predicted = by_mean = 0.0
    for demo in unseen:
        made = model.rollout(context=demo.context, tau=model.tau, dt=demo.time[1] - demo.time[0])
        predicted += np.mean((made.position[: len(mean)] - demo.position) ** 2)
        by_mean += np.mean((mean - demo.position) ** 2)
    assert predicted < 0.5 * by_mean


@pytest.mark.parametrize("basis", ["gp", "ngnet"])
def test_gait_of_boys_is_reproduced(basis: Any) -> None:
    """Cycles of only twenty samples are reproduced to 2 % of their range, from the first on."""
    demos = recordings("gait_boys", 4)
    model = pdmp.fit(demos, kind="rhythmic", period=1.0, n_styles=len(demos), basis=basis)
    assert worst_error(model, demos) <= 0.02


@pytest.mark.filterwarnings("ignore:.*from the end of the cycle")
def test_running_strides_are_reproduced() -> None:
    """Strides in three planes of three joints are reproduced to 0.5 % of their range."""
    whole = recordings("running_strides", 60)
    # The last of 101 points is the first of the next stride.
    demos = [Demonstration(demo.position[:-1], dt=0.01, names=demo.names) for demo in whole]
    model = pdmp.fit(demos, kind="rhythmic", n_styles=len(demos))
    assert worst_error(model, demos) <= 5e-3
    assert_finite(model.rollout(style=model.styles.mean(axis=0), duration=5.0))


SETS = [each for each in pdmp.datasets.REGISTRY if each != "kuka_paths"]


@pytest.mark.parametrize("name", SETS)
def test_recordings_have_no_unusual_steps_or_units(name: str) -> None:
    """No recording has an outlier, a jump, a stuck sensor or another unit, at three rates."""
    demos = recordings(name, 1)
    for step in (1, 2, 4):
        fewer = [
            Demonstration(demo.position[::step], time=demo.time[::step])
            for demo in demos
            if demo.n_samples > 4 * step
        ]
        unusual = "departs|slipped|stuck|no samples|of the others|the median:"
        assert [text for text in inspected(fewer)[1] if re.search(unusual, text)] == []


def test_jumps_within_smoothed_paths_are_found() -> None:
    """Paths whose stamps hide missing samples, by 9 to 60 steps, have a jump each."""
    _, findings = inspected(recordings("kuka_paths", 1))
    assert len(findings) == 23
    assert all("slipped sensor, or missing samples?" in text for text in findings)


def strides() -> dict[str, list[float]]:
    """Returns the durations [s] of the strides of each walk that has several."""
    path = folder("walk_styles_bandai") / "strides.csv"
    durations: dict[str, list[float]] = {}
    with path.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            durations.setdefault(row["id"], []).append(float(row["duration_s"]))
    return {name: found for name, found in durations.items() if len(found) > 1}


@pytest.mark.filterwarnings("ignore:more is gained per cycle")
def test_cycles_of_walks_last_as_long_as_their_strides() -> None:
    """Cycles of raw whole-body recordings have the period of the foot strikes.

    Of 22, three have too low an autocorrelation over all degrees of freedom: two are rejected, and
    the third has the period of two strides.
    """
    rejected, doubled = [], []
    for name, durations in strides().items():
        recording = pdmp.io.read_csv(folder("walk_styles_bandai") / "demos" / f"{name}.csv")
        try:
            cycles = pdmp.preprocessing.cycles(recording)
        except ValueError as error:
            assert "no period" in str(error)
            rejected.append(name)
            continue
        share = np.median(cycles.periods) / np.mean(durations)
        if share > 1.5:
            doubled.append(name)
        else:
            assert share == pytest.approx(1, abs=0.03), name
    assert rejected == ["walk_not-confident_001", "walk_sad_002"]
    assert doubled == ["walk_not-confident_002"]


def test_bvh_walks_give_the_period_of_their_strides() -> None:
    """BVH files with joint positions, which few parsers read, are read completely."""
    name = "walk_normal_001"
    durations = strides()[name]
    path = folder("walk_styles_bandai") / "raw" / f"dataset-1_{name}.bvh"
    recording = pdmp.preprocessing.unwrap(pdmp.io.read_bvh(path))
    assert recording.n_dofs == 132
    assert pdmp.preprocessing.period(recording) == pytest.approx(np.mean(durations), rel=0.03)


def test_walks_of_two_gaits_form_one_rhythmic_primitive() -> None:
    """Walks and runs of one person with different periods form one rhythmic primitive."""
    demos = recordings("walk_run_cmu35", 1)
    with pytest.warns(UserWarning, match=r"'root_z' gains 2\.\d+ in recording"):
        cycles = pdmp.preprocessing.cycles(demos)
    assert set(cycles.recordings) == set(range(len(demos)))
    model = pdmp.fit(cycles, kind="rhythmic", n_styles=3)
    assert (cycles.periods < 0.8).sum() == sum(demo.n_samples < 50 for demo in demos)
    assert_finite(model.rollout(duration=3.0))
