"""Batches, in chunks and on several threads, and derivatives of movements."""

import pickle
import signal
import subprocess
import sys
import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pdmp

NAN = float("nan")
FIELDS = ("position", "velocity", "acceleration")
STYLES = np.random.default_rng(0).normal(size=(23, 2))


def centre_of(model: pdmp.Model) -> str:
    """Returns the name of the argument that moves a batch as a whole."""
    return "goal" if model.kind == "discrete" else "anchor"


@pytest.mark.parametrize("names", [(), ("start",), ("velocity",), ("start", "velocity")])
@pytest.mark.parametrize("one_each", [False, True])
@pytest.mark.parametrize("dt", [0.001, 0.01])
def test_each_movement_has_its_own_conditions(
    model: pdmp.Model, names: tuple[str, ...], one_each: bool, dt: float
) -> None:
    """Movement b is the rollout of row b of batched arguments and of the shared ones."""
    rng = np.random.default_rng(1)
    shape = (len(STYLES), 2) if one_each else (2,)
    given = {name: rng.normal(size=shape) for name in (centre_of(model), *names)}
    made = model.rollouts(style=STYLES, dt=dt, tau=0.8 * model.tau, derivatives=2, **given)
    for b in (0, 7, 22):
        own = {n: rows[b] if one_each else rows for n, rows in given.items()}
        single = model.rollout(style=STYLES[b], dt=dt, tau=0.8 * model.tau, **own)
        for values, name in zip(made, FIELDS, strict=True):
            expected = getattr(single, name)
            np.testing.assert_allclose(values[b], expected, atol=1e-12 * abs(expected).max())


def test_each_discrete_movement_has_its_own_final_velocity(reach: pdmp.Model) -> None:
    """Final velocities are conditions of a batch as of a rollout, singly and for all."""
    rng = np.random.default_rng(3)
    for velocities in (rng.normal(size=(23, 2)), rng.normal(size=2)):
        (positions,) = reach.rollouts(style=STYLES, goal_velocity=velocities, derivatives=0)
        for b, velocity in enumerate(np.broadcast_to(velocities, (23, 2))):
            single = reach.rollout(style=STYLES[b], goal_velocity=velocity)
            np.testing.assert_allclose(positions[b], single.position, atol=1e-12)


def test_batch_takes_conditions_of_each_movement(model: pdmp.Model) -> None:
    """Movement b is the rollout of the b-th conditions, with the same changes."""
    listed = [model.conditions(m).replace(tau=0.7) for m in range(model.n_demos)]
    start = [0.3, -0.2]
    made = model.rollouts(listed, start=start, duration=1.0, derivatives=2)
    for b, conditions in enumerate(listed):
        single = model.rollout(conditions, start=start, duration=1.0)
        for values, name in zip(made, FIELDS, strict=True):
            expected = getattr(single, name)
            np.testing.assert_allclose(values[b], expected, atol=1e-12 * abs(expected).max())
    (one,) = model.rollouts(listed[0], start=[start, start], duration=1.0, derivatives=0)
    np.testing.assert_array_equal(one, np.stack([made[0][0]] * 2))
    assert model.rollouts(dt=0.1, duration=1.0)[0].shape == (1, 11, 2)
    assert model.rollouts([], dt=0.1, duration=1.0)[0].shape == (0, 11, 2)


def test_batch_takes_contexts_of_each_movement() -> None:
    """Movement b is the rollout for the b-th context; other conditions replace the prediction."""
    heights = np.linspace(0.1, 0.5, 6)
    s = np.linspace(0, 1, 81)
    ramp = s**3 * (10 - 15 * s + 6 * s**2)
    demos = [np.column_stack([ramp, h * np.sin(np.pi * s) ** 2]) for h in heights]
    model = pdmp.fit(demos, dt=0.01, contexts=heights[:, None], n_styles=1)
    contexts = [[0.15], [0.2], [0.43]]
    goals = np.array([[1.0, 0.1], [1.1, 0.0], [0.9, 0.2]])
    shared = {"dt": 0.02, "tau": 0.6}
    (made,) = model.rollouts(context=contexts, goal=goals, derivatives=0, **shared)
    (alone,) = model.rollouts(context=contexts[1], goal=goals, derivatives=0, **shared)
    listed = [pdmp.Conditions(goal=goal) for goal in goals]
    (also,) = model.rollouts(listed, context=np.array(contexts), derivatives=0, **shared)
    np.testing.assert_array_equal(also, made)
    for b, (context, goal) in enumerate(zip(contexts, goals, strict=True)):
        expected = model.rollout(context=context, goal=goal, **shared).position
        np.testing.assert_allclose(made[b], expected, atol=1e-12)
        expected = model.rollout(context=contexts[1], goal=goal, **shared).position
        np.testing.assert_allclose(alone[b], expected, atol=1e-12)
    for given, message in (
        ({"style": [[0.0]]}, "pass style or context, not both"),
        ({"goal": goals[:2]}, "goal has 2 rows, but there are 3 movements"),
        ({"conditions": listed[:2]}, "context has 3 rows, but there are 2 movements"),
    ):
        with pytest.raises(ValueError, match=message):
            model.rollouts(context=contexts, **given, **shared)
    slow = [np.column_stack([ramp, h * ramp]) for h in heights]
    timed = [pdmp.Demonstration(y, dt=0.01 + 0.02 * h) for y, h in zip(slow, heights, strict=True)]
    model = pdmp.fit(timed, contexts=heights[:, None], n_styles=1)
    (paced,) = model.rollouts(context=contexts, derivatives=0, dt=0.05)
    predicted = [model.predict(context).conditions.segment_durations for context in contexts]
    for b, context in enumerate(contexts):
        expected = model.rollout(
            context=context, dt=0.05, duration=max(map(sum, predicted))
        ).position
        np.testing.assert_array_equal(paced[b], expected)
    assert model.rollouts(context=contexts, tau=1.0)[0].shape[0] == 3


def test_timing_and_amplitude_of_each_movement(reach: pdmp.Model, cycle: pdmp.Model) -> None:
    """Arrays (B,) of tau and phase give rollouts to the bit, those of amplitude to 1e-12."""
    taus = np.array([0.5, 0.8, 1.1, 2.0])
    for model, more in ((reach, {}), (cycle, {"phase": [0.0, 1.0, 2.0, 3.0]})):
        made = model.rollouts(style=STYLES[:4], tau=taus, derivatives=2, dt=0.02, **more)
        longest = model.rollout(tau=taus.max(), dt=0.02).time[-1]
        listed = [
            pdmp.Conditions(
                style=STYLES[b], tau=taus[b], **{name: of[b] for name, of in more.items()}
            )
            for b in range(4)
        ]
        again = model.rollouts(listed, derivatives=2, dt=0.02)
        for b, conditions in enumerate(listed):
            single = model.rollout(conditions, dt=0.02, duration=longest)
            for order, name in enumerate(("position", "velocity", "acceleration")):
                np.testing.assert_array_equal(made[order][b], getattr(single, name))
                np.testing.assert_array_equal(again[order][b], getattr(single, name))
    amplitudes = [0.0, 0.5, 1.0, 2.0]
    positions, _ = cycle.rollouts(style=STYLES[:4], amplitude=amplitudes)
    for b, amplitude in enumerate(amplitudes):
        expected = cycle.rollout(style=STYLES[b], amplitude=amplitude).position
        np.testing.assert_allclose(positions[b], expected, atol=1e-12)
    for given, message in (
        ({"tau": taus[:3]}, "tau has 3 rows, but there are 4 movements"),
        ({"tau": [[1.0]] * 4}, r"tau has shape \[4, 1\], expected a number or \(B,\)"),
        ({"tau": [1.0, -1.0, 1.0, 1.0]}, "tau = -1"),
        ({"amplitude": taus}, "amplitude does not apply"),
    ):
        with pytest.raises(ValueError, match=message):
            reach.rollouts(style=STYLES[:4], **given)


@pytest.mark.parametrize("amplitude", [0.0, 0.4, 2.5])
def test_amplitude_is_that_of_all(cycle: pdmp.Model, amplitude: float) -> None:
    """The amplitude applies to all movements of a batch as to a rollout, zero included."""
    model = cycle
    positions, _ = model.rollouts(style=STYLES, amplitude=amplitude)
    expected = model.rollout(style=STYLES[3], amplitude=amplitude).position
    np.testing.assert_allclose(positions[3], expected, atol=1e-12)
    assert (np.ptp(positions, axis=1) == 0).all() == (amplitude == 0)


@pytest.mark.parametrize("derivatives", [0, 1, 2])
def test_number_of_arrays_follows_derivatives(model: pdmp.Model, derivatives: int) -> None:
    """The tuple has derivatives + 1 arrays, which do not depend on the number of derivatives."""
    made = model.rollouts(style=STYLES, derivatives=derivatives)
    expected = model.rollouts(style=STYLES, derivatives=2)
    assert len(made) == 1 + derivatives
    for values, full in zip(made, expected, strict=False):
        np.testing.assert_array_equal(values, full, strict=True)


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_chunks_and_threads_are_bitwise_equal(model: pdmp.Model, threads: int) -> None:
    """The chunks together equal the batch bit for bit, for any number of threads."""
    styles, velocities = np.tile(STYLES, (20, 1)), np.tile(STYLES, (20, 1)) / 3
    expected = model.rollouts(style=styles, dt=0.005, velocity=velocities, threads=1)
    whole = model.rollouts(style=styles, dt=0.005, velocity=velocities, threads=threads)
    pieces = list(
        model.rollout_chunks(style=styles, size=77, dt=0.005, velocity=velocities, threads=threads)
    )
    assert [len(positions) for positions, _ in pieces] == [77] * 5 + [75]
    for values, full, parts in zip(whole, expected, zip(*pieces, strict=True), strict=True):
        np.testing.assert_array_equal(values, full)
        np.testing.assert_array_equal(np.concatenate(parts), full)


def test_many_movements_take_little_memory(reach: pdmp.Model) -> None:
    """A million movements in chunks need little memory; one batch would take 1.4 GB."""
    model, total = reach, 0
    styles = np.zeros((10**6, 2))
    tracemalloc.start()
    for (positions,) in model.rollout_chunks(style=styles, dt=0.02, derivatives=0, duration=1.8):
        total += len(positions)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert total == 10**6
    assert peak < 5e6


def test_chunks_can_be_shared_among_threads(model: pdmp.Model) -> None:
    """Threads that share an iterator receive every chunk once."""
    styles = np.arange(600.0).reshape(300, 2)
    chunks = model.rollout_chunks(style=styles, size=7, dt=0.05, derivatives=0)
    assert iter(chunks) is chunks

    def take(_: int) -> list[float]:
        return [position[0, 0] for (positions,) in chunks for position in positions]

    with ThreadPoolExecutor(4) as pool:
        taken = sorted(x for part in pool.map(take, range(4)) for x in part)
    (expected,) = model.rollouts(style=styles, dt=0.05, derivatives=0)
    np.testing.assert_array_equal(taken, sorted(expected[:, 0, 0]))


def test_no_styles_give_no_movements(model: pdmp.Model) -> None:
    """An empty batch is valid and has no chunks."""
    none = np.zeros((0, 2))
    positions, velocities = model.rollouts(style=none, dt=0.1, duration=1.0)
    assert positions.shape == velocities.shape == (0, 11, 2)
    assert list(model.rollout_chunks(style=none)) == []


def test_cached_responses_are_bitwise_equal(model: pdmp.Model) -> None:
    """Cached responses do not change results, from several threads too."""
    times = [{"dt": dt, "tau": tau} for dt in (0.01, 0.02, 0.03, 0.05) for tau in (0.5, 0.8, 1, 2)]
    fresh: pdmp.Model = pickle.loads(pickle.dumps(model))
    expected = [pickle.loads(pickle.dumps(model)).rollouts(style=STYLES, **t)[1] for t in times]

    def ask(n: int) -> None:
        for k in np.random.default_rng(n).integers(len(times), size=60):
            np.testing.assert_array_equal(fresh.rollouts(style=STYLES, **times[k])[1], expected[k])

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(ask, range(4)))


WAYS: list[dict[str, Any]] = [
    {},
    {"start": [0.1, 0.2]},
    {"velocity": [0.5, -0.5]},
    {"start": [0.1, 0.2], "velocity": [0.5, -0.5]},
]


@pytest.mark.parametrize("given", WAYS, ids=str)
@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_movement_is_its_jacobians_times_the_changes(
    model: pdmp.Model, given: dict[str, Any], derivative: int
) -> None:
    """Changes of a rollout equal the Jacobians times the changes of its conditions."""
    rng, name = np.random.default_rng(2), FIELDS[derivative]
    style, step, shift, push = rng.normal(size=(4, 2))
    centre = centre_of(model)
    shared = {"tau": 0.7, "dt": 0.02, "duration": 1.5}
    start = {"start": given["start"]} if "start" in given else {}

    def motion(style: np.ndarray, at: np.ndarray, **given: Any) -> np.ndarray:
        values: np.ndarray = getattr(
            model.rollout(style=style, **{centre: at}, **given, **shared), name
        )
        return values

    base = motion(style, shift, **given)
    expected = base + model.jacobian("style", derivative=derivative, **given, **shared) @ step
    tolerance = 1e-11 * abs(expected).max()
    np.testing.assert_allclose(motion(style + step, shift, **given), expected, atol=tolerance)
    if model.kind == "discrete":
        jacobian = model.jacobian("goal", derivative=derivative, **shared)
    else:
        jacobian = model.jacobian("anchor", derivative=derivative, **start, **shared)
    expected = base + jacobian @ push
    np.testing.assert_allclose(motion(style, shift + push, **given), expected, atol=tolerance)
    if start:
        moved = {**given, "start": given["start"] + push}
        expected = base + model.jacobian("start", derivative=derivative, **shared) @ push
        np.testing.assert_allclose(motion(style, shift, **moved), expected, atol=tolerance)


def test_jacobian_follows_the_amplitude(cycle: pdmp.Model) -> None:
    """The Jacobian of the style is proportional to the amplitude."""
    model = cycle
    half = model.jacobian("style", amplitude=0.5, velocity=[0, 0])
    np.testing.assert_array_equal(half, model.jacobian("style", velocity=[0, 0]) / 2)


REJECTED: list[tuple[dict[str, Any], str]] = [
    ({"goal": np.zeros((3, 2))}, "goal has 3 rows, but there are 23 movements: pass one for each"),
    ({"start": np.zeros((23, 3))}, "start has length 3, expected 2: one value per DoF"),
    ({"velocity": [0.0]}, "velocity has length 1, expected 2: one value per DoF"),
    ({"start": np.where(np.arange(46) == 35, NAN, 0).reshape(23, 2)}, r"start\[17, 1\] = NaN"),
    ({"start": 0.3}, r"start has shape \[\], expected \(D,\) or \(B, D\)"),
    ({"goal": np.zeros((1, 23, 2))}, r"goal has shape \[1, 23, 2\], expected \(D,\) or \(B, D\)"),
    ({"anchor": [0, 0]}, "anchor does not apply to a discrete primitive: .*; set goal"),
    ({"style": np.zeros((4, 3))}, "style has length 3, expected 2: one value per style"),
    ({"style": np.zeros((1, 4, 2))}, r"style has shape \[1, 4, 2\], expected \(J,\) or \(B, J\)"),
    ({"style": [[0.0, 0.0], [0.0, NAN]]}, r"style\[1, 1\] = NaN"),
    ({"derivatives": 3}, r"derivatives = 3: must be 0 \(position\), 1"),
    ({"derivatives": -1}, "derivatives = -1: must not be negative"),
    ({"threads": 0}, "threads = 0: must lie between 1 and 1024"),
    ({"threads": 1025}, "threads = 1025: must lie between 1 and 1024"),
    ({"tau": 0.0}, "tau = 0: must be positive"),
    ({"dt": NAN}, "dt = NaN"),
    ({"amplitude": 2.0}, "amplitude does not apply"),
]


@pytest.mark.parametrize(("given", "message"), REJECTED, ids=str)
def test_invalid_batches_are_rejected(
    reach: pdmp.Model, given: dict[str, Any], message: str
) -> None:
    """Batches and chunks name the argument and the numbers before any computation."""
    for call in (reach.rollouts, reach.rollout_chunks):
        with pytest.raises(ValueError, match=message):
            call(**{"style": STYLES, "dt": 0.1, **given})


WRONG_TYPES: list[tuple[dict[str, Any], str]] = [
    (
        {"conditions": STYLES},
        r"conditions\[0\] = array.*: expected pdmp.Conditions; pass single ones",
    ),
    ({"conditions": 3}, "conditions = 3: expected pdmp.Conditions"),
    ({"goals": STYLES}, "unexpected keyword argument 'goals'; conditions are style, goal"),
]


@pytest.mark.parametrize(("given", "message"), WRONG_TYPES, ids=str)
def test_batches_of_a_wrong_type_are_rejected(
    reach: pdmp.Model, given: dict[str, Any], message: str
) -> None:
    """Conditions of another type and unknown keywords are rejected by name."""
    with pytest.raises(TypeError, match=message):
        reach.rollouts(**given)


@pytest.mark.parametrize("size", [0, -1])
def test_chunks_have_a_size(reach: pdmp.Model, size: int) -> None:
    """A chunk size of zero is rejected."""
    with pytest.raises(ValueError, match=f"size = {size}: must"):
        reach.rollout_chunks(style=STYLES, size=size)


def test_jacobians_of_the_other_kind_are_rejected(reach: pdmp.Model, cycle: pdmp.Model) -> None:
    """Jacobians by arguments of the other kind, and of order three, are rejected."""
    with pytest.raises(ValueError, match="goal does not apply to a rhythmic primitive"):
        cycle.jacobian("goal")
    with pytest.raises(ValueError, match="anchor does not apply to a discrete primitive"):
        reach.jacobian("anchor")
    for wrt in ("style", "start", "goal"):
        with pytest.raises(ValueError, match="derivative = 3: must be 0"):
            reach.jacobian(wrt, derivative=3)
    with pytest.raises(ValueError, match='wrt = .phase.: must be "style", "goal",'):
        reach.jacobian("phase")  # type: ignore[arg-type]


def arrays(n: int = 2) -> list[np.ndarray]:
    """Returns output arrays for the movements of `STYLES` at 0.1 s for 1 s."""
    return [np.zeros((23, 11, 2)) for _ in range(n)]


def test_outputs_are_one_for_each_derivative(reach: pdmp.Model) -> None:
    """A wrong number of output arrays is rejected with the number."""
    model, batch = reach, {"style": STYLES, "dt": 0.1, "duration": 1.0}
    for n, derivatives in ((1, 1), (2, 0), (2, 2)):
        message = f"out: {n} arrays; expected {derivatives + 1} float64 arrays"
        with pytest.raises(ValueError, match=message):
            model.rollouts(**batch, derivatives=derivatives, out=arrays(n))


def test_outputs_that_overlap_are_rejected(reach: pdmp.Model) -> None:
    """Output arrays that share memory are rejected; nothing is written."""
    model, (one, _) = reach, arrays()
    for out in ((one, one), (one, one[::-1])):
        with pytest.raises(ValueError, match="out: .*share memory"):
            model.rollouts(style=STYLES, dt=0.1, duration=1.0, out=out)
    assert not one.any()


def test_misaligned_outputs_are_rejected(reach: pdmp.Model) -> None:
    """Misaligned output arrays, such as fields of packed records, are rejected."""
    records = np.zeros((23, 11, 2), [("value", "f8"), ("other", "f4")])
    with pytest.raises(ValueError, match="out: not aligned in memory"):
        reach.rollouts(style=STYLES, dt=0.1, duration=1.0, derivatives=0, out=(records["value"],))
    assert not records["other"].any()


@pytest.mark.parametrize("order", ["C", "F"])
def test_outputs_can_have_any_strides(model: pdmp.Model, order: Any) -> None:
    """Output arrays of any strides are returned, with the numbers of a batch without them."""
    expected = model.rollouts(style=STYLES, dt=0.1, duration=1.0, derivatives=2)
    out = [np.full((23, 11, 2), NAN, order=order)[::-1] for _ in range(3)]
    made = model.rollouts(style=STYLES, dt=0.1, duration=1.0, derivatives=2, out=out)
    for mine, theirs, result in zip(out, made, expected, strict=True):
        assert theirs is mine
        np.testing.assert_array_equal(mine, result)


@pytest.mark.skipif(sys.platform != "linux", reason="this system has no limit on memory")
def test_batch_beyond_memory_is_rejected(reach: pdmp.Model, tmp_path: Path) -> None:
    """A batch beyond the memory limit raises a MemoryError with its size; its chunks fit."""
    reach.save(tmp_path / "model")
    code = f"""
import resource, numpy as np, pdmp
model, styles = pdmp.load({str(tmp_path / "model")!r}), np.zeros((10**6, 2))
resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
try:
    model.rollouts(style=styles, dt=1e-3, duration=1.0, threads=1)
except MemoryError as error:
    print(error)
print(next(model.rollout_chunks(style=styles, dt=1e-3, duration=1.0, threads=1))[0].shape)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    reported, shape = done.stdout.splitlines()
    assert reported.startswith("rollouts would take 2002000000.0 numbers: not enough memory")
    assert shape == "(1000, 1001, 2)"


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="this system has no timer signals")
def test_signal_ends_a_long_batch(reach: pdmp.Model) -> None:
    """An exception of a signal handler ends a batch."""

    class Late(Exception):
        pass

    def ring(*_: object) -> None:
        raise Late

    model, styles = reach, np.zeros((20000, 2))
    out = np.empty((20000, 1001, 2))
    model.rollouts(style=styles[:1], dt=1e-3, duration=1.0)
    before = signal.signal(signal.SIGALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.002)
        with pytest.raises(Late):
            model.rollouts(
                style=styles, dt=1e-3, duration=1.0, derivatives=0, out=(out,), threads=1
            )
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
