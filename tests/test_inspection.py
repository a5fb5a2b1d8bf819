"""Implausible samples cause warnings of a fit, a style and an evaluation."""

import re
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import pdmp
from pdmp import Demonstration

S = np.linspace(0, 1, 101)
RISE = S**3 * (10 - 15 * S + 6 * S**2)
HEIGHTS = [0.0, 0.15, 0.3, 0.45, 0.6]


def reach(height: float) -> np.ndarray:
    """Returns a reach over an obstacle, with an offset from zero."""
    return np.column_stack([0.5 + RISE, 0.2 + 64 * height * (S - S**2) ** 3])


def lost(position: np.ndarray) -> np.ndarray:
    """Returns the positions with a marker lost for 60 ms."""
    return np.where((S >= 0.4)[:, None] & (S < 0.455)[:, None], 0.0, position)


def padded(position: np.ndarray) -> np.ndarray:
    """Returns a movement of 80 samples with its last row repeated."""
    return position[np.minimum(np.arange(101) * 100 // 79, 100)]


def counted(position: np.ndarray) -> np.ndarray:
    """Returns the positions beside a counter of frames."""
    return np.column_stack([np.arange(1, 102), position])


KINDS: dict[str, tuple[Callable[[np.ndarray], np.ndarray], slice, str]] = {
    "lost": (
        lost,
        slice(2, 3),
        r'demo 2: "y0", "y1" are exactly 0 from sample 40 \(t = 0.4 s\) to',
    ),
    "padded": (padded, slice(1, 2), r"demo 1: ends in 21 copies of the row before them"),
    "counted": (
        counted,
        slice(0, 5),
        r'"y0" increases by exactly 1 per sample in every demonstration',
    ),
    "turned": (lambda y: y + 2 * np.pi, slice(3, 4), r'demo 3: "y0" lies 1 full turn of 6.283'),
}


@pytest.mark.parametrize("kind", KINDS)
def test_fit_style_and_evaluation_warn_of_the_place(kind: str) -> None:
    """Each warning names demonstration, degree of freedom and sample, at the line of the caller."""
    change, which, text = KINDS[kind]
    demos = [reach(height) for height in HEIGHTS]
    demos[which] = [change(demo) for demo in demos[which]]
    contexts = [[height] for height in HEIGHTS]
    with pytest.warns(UserWarning, match=text) as caught:
        pdmp.fit(demos, dt=0.01, contexts=contexts)
    assert caught[0].filename == __file__
    with pytest.warns(UserWarning, match=text) as caught:
        pdmp.evaluate(demos, contexts=contexts, dt=0.01, predictors={})
    assert caught[0].filename == __file__


def test_style_of_warns_of_lost_samples() -> None:
    """A recording whose style is inferred is inspected like those of the fit."""
    model = pdmp.fit([reach(height) for height in HEIGHTS], dt=0.01, n_styles=2)
    with pytest.warns(UserWarning, match=r'"y0", "y1" are exactly 0'), pytest.raises(ValueError):
        model.style_of(Demonstration(lost(reach(0.3)), dt=0.01))


def test_clean_and_noisy_movements_are_learnt_without_a_warning() -> None:
    """Zeros, rest and noise of three percent of the range cause no warning."""
    rng = np.random.default_rng(0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for noise in (0.0, 1e-3, 0.02):
            demos = [reach(h) - [0.5, 0.2] + noise * rng.normal(size=(101, 2)) for h in HEIGHTS]
            pdmp.fit(demos, dt=0.01)


def test_turns_between_recordings_of_an_angle_are_removed() -> None:
    """Full turns between recordings of an angle are removed, in an evaluation too."""
    demos = [
        Demonstration(
            reach(h) + [2 * np.pi * (k == 3), 0], dt=0.01, units=["rad", "m"], context=[h]
        )
        for k, h in enumerate(HEIGHTS)
    ]
    with pytest.warns(UserWarning, match="the turns were subtracted"):
        model = pdmp.fit(demos)
    np.testing.assert_allclose(model.goals[:, 0], 1.5, atol=1e-9)
    with pytest.warns(UserWarning):
        found = pdmp.evaluate(demos, predictors={"PDMP": pdmp.evaluation.PDMP()})
    assert found.scores["PDMP"].error.max() < 0.01


def test_gaps_across_a_wrap_need_the_unit(tmp_path: Path) -> None:
    """A gap across a wrap needs a unit of angle, which gives the shorter path."""
    angle = np.pi * (0.9 + 1.9 * S)
    wrapped = np.angle(np.exp(1j * angle))
    rows = np.column_stack([S, wrapped]).astype(object)
    missing = (np.abs(angle - np.pi) < 0.15) & (S > 0)
    rows[missing, 1] = ""
    for header, rejected in (("t,q", True), ("t,q [rad]", False)):
        path = tmp_path / "angle.csv"
        path.write_text("\n".join([header, *(f"{t},{q}" for t, q in rows)]))
        if rejected:
            with pytest.raises(
                ValueError, match=r"column 'q': changes by -5.\d+ in the gap.*\[rad\]"
            ):
                pdmp.io.read_csv(path, max_gap=0.5)
        else:
            whole = pdmp.preprocessing.unwrap(pdmp.io.read_csv(path, max_gap=0.5))
            np.testing.assert_allclose(whole.position[:, 0], angle, atol=1e-6)


def test_open_cycles_are_reported_with_the_step() -> None:
    """A reach that is fitted as a cycle is reported with the step from its end to its start."""
    s = np.linspace(0, 1, 101)
    reach = np.column_stack([s**3 * (10 - 15 * s + 6 * s**2), np.sin(np.pi * s) ** 2])
    with pytest.warns(UserWarning, match=r'demo 0: "y0" steps by 1 from the end of the cycle'):
        pdmp.fit([reach], dt=0.01, kind="rhythmic")


def test_repeated_first_sample_of_a_cycle_is_reported() -> None:
    """A cycle that ends with the first sample of the next one is reported, and no other."""
    phase = np.linspace(0, 2 * np.pi, 101)
    cycle = np.column_stack([np.sin(phase), np.cos(phase)])
    with pytest.warns(UserWarning, match="demo 0: the last sample repeats the first"):
        pdmp.fit([cycle], dt=0.01, kind="rhythmic")
    model = pdmp.fit([cycle[:-1]], dt=0.01, kind="rhythmic")
    assert np.abs(model.rollout(dt=0.001).acceleration).max() == pytest.approx(39.5, rel=0.01)


def test_closed_cycles_are_not_reported() -> None:
    """Cycles of any length and shape, clean or noisy, close in one sampling interval."""
    random = np.random.default_rng(0)
    for _ in range(100):
        phase = np.linspace(0, 2 * np.pi, random.integers(20, 300), endpoint=False)[:, None]
        waves = range(1, 6)
        cycle = sum(
            random.normal(size=3) / k**2 * np.cos(k * phase + random.uniform(0, 6, 3))
            for k in waves
        )
        cycle = cycle + random.choice([0, 1e-3, 1e-2]) * random.normal(size=(len(phase), 3))
        with warnings.catch_warnings():
            warnings.filterwarnings("error", message=".*cycle")
            pdmp.fit([cycle], dt=0.01, kind="rhythmic", n_styles=1)


NAMES = {"names": ["j1", "j2"], "units": ["rad", "rad"]}


def recorded(
    change: Callable[[int, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
) -> list[Demonstration]:
    """Returns noisy reaches of angles, each changed by its number, times and positions."""
    rng = np.random.default_rng(3)
    time = np.arange(101) * 0.01
    demos = []
    for k, height in enumerate(HEIGHTS):
        stamps, position = change(k, time, reach(height) + 0.003 * rng.normal(size=(101, 2)))
        demos.append(Demonstration(position, time=stamps, **NAMES))
    return demos


def of_one(
    change: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
) -> list[Demonstration]:
    """Returns noisy reaches the fourth of which is changed."""
    return recorded(lambda k, t, y: change(t, y) if k == 3 else (t, y))


def added(
    rows: slice, size: float
) -> Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Returns a change of the second joint in some rows."""

    def change(time: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        position[rows, 1] += size
        return time, position

    return change


def held(time: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns a recording whose first joint repeats its value."""
    position[40:60, 0] = position[40, 0]
    return time, position


def without(time: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns a recording without its middle half."""
    kept = np.r_[0:25, 75:101]
    return time[kept], position[kept]


WRONG = {
    "outlier": (
        added(slice(60, 61), 1.0),
        r'demo 3: "j2" departs by .* at sample 60 \(t = 0.6 s\) and returns, in steps \d+ times '
        r".*: outliers\? .*NaN",
    ),
    "jump": (
        added(slice(60, None), 0.5),
        r'demo 3: "j2" jumps by 0.\d+ at sample 60 \(t = 0.6 s\), \d+ times .*split_at',
    ),
    "far": (added(slice(60, None), 30.0), r'demo 3: "j2" jumps by .* a slipped sensor'),
    "stuck": (
        held,
        r'demo 3: "j1" is constant from sample 40 .* to sample 59 .* then jumps by .*: '
        r"a stuck sensor\?",
    ),
    "degrees": (
        lambda t, y: (t, np.degrees(y)),
        r"demo 3: range [\d.]+ times that of the others: degrees among radians\?",
    ),
    "ms": (
        lambda t, y: (1000 * t, y),
        r"demo 3: duration of 1000 s, 1000 times the median: ms among s\?",
    ),
    "rows": (
        without,
        r"demo 3: no samples between sample 24 \(t = 0.24 s\) and sample 25 \(t = 0.75 s\), "
        r"for 51 times",
    ),
}


@pytest.mark.parametrize("kind", WRONG)
@pytest.mark.parametrize("blocks", [False, True])
def test_wrong_samples_units_and_stamps_are_reported_once(kind: str, blocks: bool) -> None:
    """A fault of one demonstration causes a warning of its place, in a fit of blocks too."""
    change, text = WRONG[kind]
    demos = of_one(change)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        pdmp.fit([demos[:2], demos[2:]] if blocks else demos)
    found = [str(warning.message) for warning in caught if str(warning.message).startswith("demo")]
    assert len(found) == 1
    assert re.match(text, found[0]), found[0]


def test_missing_rows_are_an_error_beyond_max_gap(tmp_path: Path) -> None:
    """A positive `max_gap` applies to time stamps too; intervals of the usual length are no gap."""
    path = tmp_path / "rows.csv"
    rows = [f"{0.01 * k:.2f},{y}" for k, y in enumerate(RISE) if not 40 <= k < 60]
    path.write_text("\n".join(["t,q", *rows]))
    with pytest.raises(
        ValueError, match=r"no row between t = 0.39 s and t = 0.6 s.*max_gap = 0.05 s"
    ):
        pdmp.io.read_csv(path, max_gap=0.05)
    assert pdmp.io.read_csv(path).n_samples == pdmp.io.read_csv(path, max_gap=0.22).n_samples == 81
    path.write_text("\n".join(["t,q", *rows[:40]]))
    assert pdmp.io.read_csv(path, max_gap=0.001).n_samples == 40
