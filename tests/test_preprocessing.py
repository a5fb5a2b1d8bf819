"""Preprocessing of raw recordings: cycles, unwrapped angles, filters, resampling."""

import pickle
from pathlib import Path

import numpy as np
import pandas
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import pdmp

STRIDE = 1.17
UNITS = ["rad", "rad", "m"]


# The pelvis of these walks advances; one test claims the warning about it, the others ignore it.
pytestmark = pytest.mark.filterwarnings("ignore:more is gained per cycle")


def walk(n: int = 700, dt: float = 0.01, phase: float = 0.0) -> NDArray[np.float64]:
    """Returns both hips [rad] and a pelvis [m] that advances at 1.3 m/s."""
    t = np.arange(n) * dt
    phi = 2 * np.pi * t / STRIDE + phase
    pelvis = 1.3 * t + 0.02 * np.sin(2 * phi)
    return np.column_stack([0.4 * np.sin(phi), -0.4 * np.sin(phi + 0.1), pelvis])


def recording(**given: object) -> pdmp.Demonstration:
    """Returns a walk at 100 Hz with names and units."""
    options = {"dt": 0.01, "names": ["hip_l", "hip_r", "pelvis"], "units": UNITS} | given
    return pdmp.Demonstration(walk(), **options)  # type: ignore[arg-type]


@pytest.fixture
def raw(tmp_path: Path) -> Path:
    """Returns the file of a raw recording with jitter, noise, a gap and an outlying stride."""
    rng = np.random.default_rng(5)
    t = np.arange(700) * 0.01 + rng.uniform(-0.003, 0.003, 700)
    position = np.array([np.interp(t, np.arange(700) * 0.01, y) for y in walk().T]).T
    position += 0.002 * rng.standard_normal(position.shape)
    position[(t > 3 * STRIDE) & (t < 4 * STRIDE), 0] *= 0.3
    fields = [[f"{x:.6f}" for x in row] for row in np.column_stack([1000 * t, position])]
    for row in range(300, 304):
        fields[row][2] = ""
    lines = ["t [ms],hip_l [rad],hip_r [rad],pelvis [m]", *(",".join(row) for row in fields)]
    path = tmp_path / "walk.csv"
    path.write_text("\n".join(lines))
    return path


def test_a_raw_walk_becomes_a_rhythmic_primitive(raw: Path) -> None:
    """Two lines convert a file to a model with its units and period, without a jump."""
    cycles = pdmp.preprocessing.cycles(pdmp.io.read_csv(raw, max_gap=0.1))
    model = pdmp.fit(cycles, kind="rhythmic", smoothing="auto")
    assert model.units == UNITS
    assert np.median(model.durations) == pytest.approx(STRIDE, rel=0.01)
    assert model.n_demos == len(cycles) == 4
    (odd,) = cycles.rejected
    assert odd.start == pytest.approx(3 * STRIDE, abs=0.05)
    assert "standard deviations from the median cycle" in odd.reason
    made = model.rollout(duration=2 * STRIDE, dt=0.005)
    assert np.abs(np.diff(made.position[:, 0])).max() < 2 * 0.4 * 2 * np.pi / STRIDE * 0.005


def test_cycles_last_as_long_as_their_samples() -> None:
    """T · dt is the period; names, units and context are kept, the goal is not."""
    cycles = pdmp.preprocessing.cycles(recording(context=[1.3], goal=[0, 0, 9]))
    for cycle, period in zip(cycles, cycles.periods, strict=True):
        assert cycle.dt is not None
        assert cycle.n_samples * cycle.dt == pytest.approx(period, rel=1e-12)
        assert (cycle.units, cycle.context, cycle.goal) == (UNITS, [1.3], None)


def test_a_mean_cycle_has_less_noise() -> None:
    """The noise of a mean cycle falls with the square root of the number of cycles."""
    rng = np.random.default_rng(1)
    noisy = pdmp.Demonstration(walk(2000) + 0.02 * rng.standard_normal((2000, 3)), dt=0.01)

    def noise(cycle: pdmp.Demonstration) -> float:
        return float(np.std(np.diff(cycle.position[:, 0], 3)))

    each, mean = pdmp.preprocessing.cycles(noisy), pdmp.preprocessing.cycles(noisy, average=True)
    assert len(mean) == 1
    assert noise(mean[0]) < 0.5 * np.median([noise(cycle) for cycle in each])


def test_cycles_have_their_recording_and_a_common_phase() -> None:
    """Each cycle has the index of its recording, and the phase of those of the first recording."""
    found = pdmp.preprocessing.cycles(
        [pdmp.Demonstration(walk(phase=p), dt=0.01) for p in (0.0, 2.0, 5.0)]
    )
    assert set(found.recordings) == {0, 1, 2}
    starts = np.array([cycle.position[0, :2] for cycle in found])
    np.testing.assert_allclose(starts, starts[:1].repeat(len(starts), axis=0), atol=0.02)


def reach() -> pdmp.Demonstration:
    """Returns a movement that is not periodic."""
    s = np.linspace(0, 1, 200)
    return pdmp.Demonstration(np.column_stack([s**3, s, s**2 * (3 - 2 * s)]), dt=0.01)


def test_a_recording_without_a_period_is_rejected_with_its_correlation() -> None:
    """The error states the recording, its autocorrelation and the threshold."""
    with pytest.raises(
        ValueError, match=r"demo 0: no period: .* correlation of -?\d\.\d+, below 0\."
    ):
        pdmp.preprocessing.cycles([reach(), reach()])


def test_a_recording_without_a_period_among_others_is_left_out_with_a_warning() -> None:
    """Other recordings are cut; the rejected one is listed with its correlation and duration."""
    with pytest.warns(UserWarning, match=r"recording 1 is left out: no period: .* correlation of"):
        found = pdmp.preprocessing.cycles([recording(), reach(), recording()])
    assert set(found.recordings) == {0, 2}
    (rejected,) = [cycle for cycle in found.rejected if cycle.recording == 1]
    assert (rejected.start, rejected.period) == (0.0, pytest.approx(1.99))
    assert "no period" in rejected.reason


def test_the_turns_of_a_crank_are_removed() -> None:
    """Full turns per cycle are removed without a warning."""
    t = 0.01 * np.arange(len(walk()))
    crank = 2 * np.pi * t / STRIDE + 0.2 * np.sin(2 * np.pi * t / STRIDE)
    turning = np.column_stack([walk()[:, :2], crank])
    for unit in ("rad", ""):
        found = pdmp.preprocessing.cycles(
            pdmp.Demonstration(turning, dt=0.01, units=["rad", "rad", unit])
        )
        (growth,) = found.growths
        assert (growth.dof, growth.turns) == (2, 1)
        assert growth.gain == pytest.approx(2 * np.pi, rel=0.01)
        np.testing.assert_allclose(found.gains[:, 2], 2 * np.pi, rtol=0.02)
        assert np.ptp([cycle.position[:, 2].mean() for cycle in found]) < 0.1


def test_a_gain_per_cycle_causes_a_warning_with_its_size() -> None:
    """A gain per cycle, such as of a walk, causes a warning with name, gain and unit."""
    with pytest.warns(UserWarning, match=r"'pelvis' gains 1\.52 m in recording 0; closed cycles"):
        found = pdmp.preprocessing.cycles(recording())
    assert found.gains.shape == (len(found), 3)
    np.testing.assert_allclose(found.gains[:, 2], 1.3 * STRIDE, rtol=0.01)
    assert np.abs(found.gains[:, :2]).max() < 0.02


def test_resampling_adds_no_styles_of_noise() -> None:
    """Upsampled noisy reaches, and cycles of a noisy walk, have one style each."""
    rng = np.random.default_rng(2)
    s = np.linspace(0, 1, 101)
    path = np.column_stack([s**3 * (10 - 15 * s + 6 * s**2), (4 * s * (1 - s)) ** 3])
    reaches = [
        pdmp.Demonstration(path + 0.003 * rng.standard_normal(path.shape), dt=0.01)
        for _ in range(50)
    ]
    twice = [pdmp.preprocessing.resample(demo, 0.005) for demo in reaches]
    assert pdmp.fit(twice, smoothing="auto").n_styles == 1
    noisy = walk(3000)[:, :2] + 0.003 * rng.standard_normal((3000, 2))
    cycles = pdmp.preprocessing.cycles(pdmp.Demonstration(noisy, dt=0.01))
    assert pdmp.fit(cycles, kind="rhythmic", smoothing="auto").n_styles == 1


def test_trimming_finds_the_rests_beside_a_noisy_movement() -> None:
    """One second of movement between rests of 0.8 s is kept with a noise of a thousandth."""
    s = np.clip(np.linspace(-0.8, 1.8, 261), 0, 1)
    path = np.column_stack([s**3 * (10 - 15 * s + 6 * s**2), -(s**2) * (3 - 2 * s)])
    for seed in range(5):
        noise = 1e-3 * np.random.default_rng(seed).standard_normal(path.shape)
        kept = pdmp.preprocessing.trim(pdmp.Demonstration(path + noise, dt=0.01))
        assert 90 <= kept.n_samples <= 110


def test_onsets_replace_the_search() -> None:
    """One recording takes one list of onsets; several need one each."""
    found = pdmp.preprocessing.cycles(recording(), onsets=[0.5, 1.5, 2.6])
    np.testing.assert_allclose(found.periods, [1.0, 1.1])
    with pytest.raises(ValueError, match="onsets has length 1, expected 2"):
        pdmp.preprocessing.cycles([recording(), recording()], onsets=[[0.5, 1.5]])


@given(
    st.floats(-3, 3),
    st.floats(-0.9, 0.9),
    st.integers(5, 60),
    st.sampled_from(["rad", "deg", "degrees"]),
)
def test_unwrapping_undoes_wrapping(start: float, step: float, n: int, unit: str) -> None:
    """An angle with less than half a turn per sample is restored up to full turns."""
    turn = {"rad": 2 * np.pi, "deg": 360.0, "degrees": 360.0}[unit]
    angle = start + step * np.pi * np.arange(n)
    wrapped = ((angle + np.pi) % (2 * np.pi) - np.pi) * turn / (2 * np.pi)
    position = np.column_stack([wrapped, wrapped])
    demo = pdmp.preprocessing.unwrap(pdmp.Demonstration(position, dt=0.1, units=[unit, "m"]))
    expected = (angle - angle[0]) * turn / (2 * np.pi)
    np.testing.assert_allclose(demo.position[:, 0] - wrapped[0], expected, atol=1e-9 * turn * n)
    np.testing.assert_array_equal(demo.position[:, 1], wrapped)


def test_a_goal_turns_with_the_last_sample() -> None:
    """The goal moves with the last sample by full turns."""
    wrapped = np.array([[3.0], [3.1], [-3.1], [-3.0]])
    demo = pdmp.preprocessing.unwrap(pdmp.Demonstration(wrapped, dt=0.1, goal=[-2.9]))
    assert demo.goal is not None
    assert demo.goal[0] - demo.position[-1, 0] == pytest.approx(0.1)


def test_preprocessing_keeps_names_units_context_and_goal() -> None:
    """Filters, resampling and trimming keep names, units, context and goal."""
    whole = recording(context=[1.0], goal=[0, 0, 9])
    for demo in (
        pdmp.preprocessing.lowpass(whole, 6),
        pdmp.preprocessing.resample(whole, 0.02),
        pdmp.preprocessing.trim(whole),
    ):
        assert (demo.names, demo.units) == (whole.names, UNITS)
        assert demo.context == [1.0]
        np.testing.assert_array_equal(demo.goal, [0, 0, 9])


def test_units_survive_pickling_and_saving(tmp_path: Path) -> None:
    """Demonstration, model and model file have the same units."""
    cycles = pdmp.preprocessing.cycles(recording())
    assert pickle.loads(pickle.dumps(cycles[0])).units == UNITS
    model = pdmp.fit(cycles, kind="rhythmic")
    model.save(tmp_path / "walk.safetensors")
    assert pdmp.load(tmp_path / "walk.safetensors").units == model.units == UNITS
    assert pdmp.fit([walk(50)], dt=0.01).units == ["", "", ""]


def test_units_must_agree() -> None:
    """Demonstrations must have the same units, one per degree of freedom."""
    other = pdmp.Demonstration(walk(), dt=0.01, units=["deg", "deg", "m"])
    with pytest.raises(ValueError, match=r'demo 1: units\[0\] = "deg", but demo 0 has "rad"'):
        pdmp.fit([pdmp.Demonstration(walk(), dt=0.01, units=UNITS), other])
    with pytest.raises(ValueError, match="units has length 1, expected 3"):
        pdmp.Demonstration(walk(), dt=0.01, units=["rad"])


def test_a_recording_needs_a_clock() -> None:
    """Functions that need times reject recordings without them."""
    bare = pdmp.Demonstration(walk())
    for call in (pdmp.preprocessing.period, pdmp.preprocessing.trim, pdmp.preprocessing.cycles):
        with pytest.raises(ValueError, match=r"time is unknown: .*dt= or time="):
            call(bare)


def test_cycles_are_fitted_as_a_rhythm_without_the_kind() -> None:
    """The kind of a fit to cycles is rhythmic by default, and can be given."""
    time = 0.01 * np.arange(800)
    walk = np.column_stack([np.cos(5.7 * time), np.sin(5.7 * time + 0.3 * np.cos(5.7 * time))])
    cycles = pdmp.preprocessing.cycles(pdmp.Demonstration(walk, dt=0.01))
    assert pdmp.fit(cycles).kind == pdmp.fit(cycles, kind="rhythmic").kind == "rhythmic"
    assert pdmp.fit(list(cycles)).kind == pdmp.fit(cycles, kind="discrete").kind == "discrete"


def test_cycles_have_the_named_contexts_of_their_recordings() -> None:
    """Each cycle has the values of its recording, under the names that a reader found."""
    time = 0.01 * np.arange(800)
    walks = {
        speed: np.column_stack([speed * np.cos(5.7 * time), np.sin(5.7 * time)])
        for speed in (0.8, 1.2)
    }
    frames = [
        pandas.DataFrame(
            {"trial": f"{speed}", "t": time, "x": walk[:, 0], "y": walk[:, 1], "speed": speed}
        )
        for speed, walk in walks.items()
    ]
    demos = pdmp.io.from_dataframe(pandas.concat(frames), by="trial", context=["speed"])
    trimmed = pdmp.preprocessing.trim(demos)
    assert trimmed.contexts == demos.contexts == {"speed": [0.8, 1.2]}
    cycles = pdmp.preprocessing.cycles(demos)
    assert cycles.contexts == {"speed": [(0.8, 1.2)[k] for k in cycles.recordings]}
    assert pdmp.fit(cycles).context_names == ["speed"]
