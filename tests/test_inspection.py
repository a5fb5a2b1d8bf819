"""Implausible samples cause warnings of a fit, a style and an evaluation."""

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
