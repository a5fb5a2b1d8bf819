"""Time warps and landmarks: alignment, prediction and reproduction of timing."""

import pickle

import numpy as np
import pytest

import pdmp
from pdmp import Demonstration, TimeWarp

N = 201
SHARES = np.linspace(0, 1, N)


def reach(phase: np.ndarray, height: float = 0.3) -> np.ndarray:
    """Returns a reach over an obstacle at phases in [0, 1]."""
    rise = phase**3 * (10 - 15 * phase + 6 * phase**2)
    return np.column_stack([rise, height * 64 * (phase - phase**2) ** 3, np.sin(6 * phase)])


def warped_phase(bend: float) -> np.ndarray:
    """Returns phases that are ahead of linear time by up to `bend` / 3 half way."""
    return SHARES + bend * SHARES * (1 - SHARES)


def demos(bends: list[float], heights: list[float] | None = None) -> list[Demonstration]:
    """Returns reaches of 1 s with different time courses."""
    heights = [0.3] * len(bends) if heights is None else heights
    return [
        Demonstration(reach(warped_phase(bend), height), dt=1 / (N - 1), context=[bend])
        for bend, height in zip(bends, heights, strict=True)
    ]


def test_movements_that_differ_in_time_alone_have_one_singular_value() -> None:
    """After a warp, movements that differ in their time course alone have one singular value."""
    training = demos([0.0, 0.4, -0.4, 0.2, -0.2])
    linear, warped = (pdmp.fit(training, nominal=0, alignment=a) for a in ("linear", "warp"))

    def rest(model: pdmp.Model) -> float:
        return np.linalg.norm(model.singular_values[1:]) / model.singular_values[0]

    assert rest(warped) < 0.1 * rest(linear)
    assert linear.segment_durations.shape == (5, 1) and warped.segment_durations.shape == (5, 8)
    np.testing.assert_allclose(warped.segment_durations.sum(axis=1), warped.durations)
    np.testing.assert_allclose(warped.durations, linear.durations, rtol=1e-12)


@pytest.mark.parametrize("alignment", ["warp", TimeWarp(5, max_slope=3)])
def test_demonstrations_are_reproduced_with_their_time_course(alignment: str | TimeWarp) -> None:
    """The conditions of a demonstration reproduce it with its time course."""
    training = demos([0.0, 0.4, -0.4], [0.3, 0.2, 0.4])
    model = pdmp.fit(training, nominal=0, alignment=alignment, n_styles=3)
    for m, demo in enumerate(training):
        made = model.rollout(model.conditions(m), dt=1 / (N - 1))
        np.testing.assert_allclose(made.position, demo.position, atol=0.01)
        rates = np.gradient(made.position, made.time, axis=0)
        np.testing.assert_allclose(rates[2:-2], made.velocity[2:-2], atol=0.05)
    style = model.style_of(training[1])
    np.testing.assert_allclose(style, model.styles[1], atol=0.01)


def test_landmarks_are_aligned() -> None:
    """Landmarks of all demonstrations are aligned with those of the nominal one."""
    training = demos([0.0, 0.4, -0.4])
    phases = np.array([0.25, 0.7])
    landmarks = np.array(
        [np.interp(phases, warped_phase(bend), SHARES) for bend in (0.0, 0.4, -0.4)]
    )
    model = pdmp.fit(training, nominal=0, landmarks=landmarks, n_styles=3)
    np.testing.assert_allclose(model.breaks, [0, *phases, 1])
    np.testing.assert_allclose(np.cumsum(model.segment_durations, axis=1)[:, :2], landmarks)
    np.testing.assert_allclose(
        model.style_of(training[2], landmarks=landmarks[2]), model.styles[2], atol=0.01
    )
    with pytest.raises(
        ValueError, match="landmarks is missing: the model was fitted with landmarks"
    ):
        model.style_of(training[2])


def test_timing_is_predicted_from_the_context() -> None:
    """A time course that depends on the context is predicted for a new context, with a band."""
    model = pdmp.fit(demos(list(np.linspace(-0.4, 0.4, 9))), nominal=4, alignment=TimeWarp())
    found = model.predict([0.15])
    assert found.conditions.segment_durations.shape == (8,) and found.duration == pytest.approx(
        1, abs=1e-6
    )
    size = model.n_styles + 2 * model.n_dofs + 8
    assert found.covariance.shape == (size, size)
    made = model.rollout(context=[0.15], dt=1 / (N - 1)).position
    np.testing.assert_allclose(made, reach(warped_phase(0.15)), atol=0.02)
    lower, upper = model.band([0.15], dt=1 / (N - 1))
    np.testing.assert_allclose((lower + upper) / 2, made, atol=1e-12)


def test_default_warp_predicts_no_worse_than_linear_scaling() -> None:
    """Variation in time that contexts do not explain is not warped; without contexts it is."""
    rng = np.random.default_rng(3)
    heights = np.linspace(0.2, 0.4, 12)
    training = demos(list(rng.uniform(-0.5, 0.5, 12)), list(heights))
    contexts = heights[:, None]
    assert pdmp.fit(training, contexts=contexts, alignment="warp").segment_durations.shape == (
        12,
        1,
    )
    assert pdmp.fit(training, contexts=contexts, alignment=TimeWarp()).segment_durations.shape == (
        12,
        8,
    )
    bare = [demo.position for demo in training]
    assert pdmp.fit(bare, dt=1 / (N - 1), alignment="warp").segment_durations.shape == (12, 8)


def test_default_warp_has_fewer_segments_on_short_recordings() -> None:
    """Eight segments need 16 samples; an explicit number is rejected with that bound."""
    short = [demo.position[::20] for demo in demos([0.0, 0.4, -0.4])]  # 11 samples
    assert pdmp.fit(short, dt=0.1, alignment="warp").segment_durations.shape == (3, 5)
    with pytest.raises(ValueError, match="segments = 8: must lie between 1 and 5"):
        pdmp.fit(short, dt=0.1, alignment=TimeWarp())


def test_a_band_includes_the_uncertainty_of_timing() -> None:
    """The band includes variation of time courses: it contains nine tenths of new movements."""
    rng = np.random.default_rng(5)
    inside = []
    for _ in range(6):
        bends = list(rng.uniform(-0.5, 0.5, 14))
        training = demos(bends, list(np.linspace(0.2, 0.4, 14)))
        heights = np.linspace(0.2, 0.4, 14)[:, None]
        model = pdmp.fit(training, contexts=heights, alignment=TimeWarp())
        lower, upper = model.band([0.3], dt=1 / (N - 1))
        for bend in rng.uniform(-0.5, 0.5, 10):
            new = reach(warped_phase(bend))
            inside.append(((lower <= new) & (new <= upper))[40:-40].mean())
    assert 0.8 < np.mean(inside) < 0.99


def test_a_loop_follows_a_timing() -> None:
    """A controller whose tau is set at every tick follows the rollout."""
    model = pdmp.fit(demos([0.0, 0.4, -0.4]), nominal=0, alignment="warp")
    given = model.conditions(1)
    planned = model.rollout(given, dt=0.001).position
    controller = model.controller(0.001, given, transition=0)
    for row in planned[1:]:
        controller.tau = model.tau_at(controller.phase, given.segment_durations)
        controller.step()
        np.testing.assert_allclose(controller.position, row, atol=0.01)


def test_timing_survives_a_file() -> None:
    """A loaded model reproduces timing bit for bit."""
    model = pdmp.fit(demos([0.0, 0.4, -0.4]), alignment="warp")
    other = pickle.loads(pickle.dumps(model))
    np.testing.assert_array_equal(other.breaks, model.breaks)
    np.testing.assert_array_equal(other.segment_durations, model.segment_durations)
    a, b = (m.rollout(m.conditions(1), dt=0.01) for m in (model, other))
    np.testing.assert_array_equal(a.position, b.position)
    np.testing.assert_array_equal(other.style_of(demos([0.3])[0]), model.style_of(demos([0.3])[0]))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"alignment": "elastic"},
            'alignment = \'elastic\': must be "linear", "warp" or pdmp.TimeWarp',
        ),
        ({"alignment": TimeWarp(101)}, "segments = 101: must lie between 1 and 100"),
        ({"landmarks": [[0.5], [0.5]]}, "landmarks has length 2, expected 3: one value per demo"),
        ({"landmarks": [[0.5, 0.4]] * 3}, r"landmarks\[1\] = 0.4 s must come after 0.5 s"),
        ({"landmarks": [[np.nan]] * 3}, "landmarks"),
        ({"landmarks": [[0.5]] * 3, "alignment": "warp"}, "pass a warp or landmarks, not both"),
    ],
)
def test_invalid_alignments_are_rejected(options: dict[str, object], message: str) -> None:
    """An invalid alignment is named with the expected form."""
    with pytest.raises(ValueError, match=message):
        pdmp.fit(demos([0.0, 0.4, -0.4]), **options)


@pytest.mark.parametrize(
    ("arguments", "message"), [((0,), "segments = 0"), ((8, 0.5), "slope = 0.5")]
)
def test_warps_out_of_range_are_rejected(arguments: tuple[float, ...], message: str) -> None:
    """A warp without segments, or with a slope below one, is rejected."""
    with pytest.raises(ValueError, match=message):
        TimeWarp(*arguments)


def test_tau_and_timing_exclude_each_other() -> None:
    """Tau and segment durations cannot both be given."""
    model = pdmp.fit(demos([0.0, 0.4, -0.4]), alignment="warp")
    with pytest.raises(ValueError, match="pass tau or segment_durations, not both"):
        model.rollout(tau=1.0, segment_durations=model.segment_durations[0])
    with pytest.raises(ValueError, match="segment_durations has length 2, expected 8"):
        model.rollout(segment_durations=[0.5, 0.5])
    with pytest.raises(ValueError, match="segment_durations"):
        model.rollout(segment_durations=[-1.0] + [0.1] * 7)
