"""The control loop in Python: memory, threads and clock."""

import asyncio
import copy
import gc
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp import Status, realtime

NAN, INF = float("nan"), float("inf")


def blocks(work: Callable[[], object]) -> int:
    """Returns the growth of the number of Python's memory blocks in a second run of a function."""
    work()
    gc.collect()
    before = sys.getallocatedblocks()
    work()
    return sys.getallocatedblocks() - before


def test_a_hundred_thousand_ticks_accumulate_no_memory(model: pdmp.Model) -> None:
    """Steps, commands as arrays and reads of views do not accumulate memory."""
    controller = model.controller(0.01)
    style, place = np.array([0.1, 0.2]), np.array([0.3, -0.1])
    centre = "goal" if model.kind == "discrete" else "anchor"

    def work() -> None:
        for _ in range(50_000):
            controller.style = style
            setattr(controller, centre, place)
            controller.step(measured=controller.position, coupling=(place, place))

    assert blocks(work) < 20


def test_a_tick_creates_no_object(model: pdmp.Model) -> None:
    """A tick returns the same object, and its views stay at the same addresses."""
    controller = model.controller(0.01)
    names = ("position", "velocity", "acceleration")
    places = []
    status = controller.step()
    for _ in range(9):
        assert controller.step() is status
        places.append([getattr(controller, name).ctypes.data for name in names])
    assert all(place == places[0] for place in places)


def test_views_outlive_the_controller_unchanged(model: pdmp.Model) -> None:
    """Memory of a deleted controller is not reused while views exist."""
    controller = model.controller(0.01)
    controller.step()
    views = controller.position, controller.velocity, controller.acceleration
    expected = [view.copy() for view in views]
    del controller
    gc.collect()
    others = [model.controller(0.01, start=[9, 9]) for _ in range(100)]
    for view, values in zip(views, expected, strict=True):
        np.testing.assert_array_equal(view, values)
        assert not any(np.shares_memory(view, other.position) for other in others)


def test_ticks_of_two_threads_are_atomic(model: pdmp.Model) -> None:
    """With two threads on one controller, ticks are atomic and errors clean."""
    controller = model.controller(0.001)
    centre = "goal" if model.kind == "discrete" else "anchor"
    end = time.perf_counter() + 0.5
    other: list[BaseException] = []

    def hammer(sign: float) -> int:
        ticks = 0
        place = np.array([sign, 0.5 * sign])
        while time.perf_counter() < end:
            try:
                controller.style = [0.1 * sign, 0.2]
                setattr(controller, centre, place)
                controller.step(measured=list(controller.position), coupling=(place, place))
                ticks += 1
                assert np.isfinite(controller.velocity).all()
            except RuntimeError as error:
                assert "borrowed" in str(error)
            except BaseException as error:
                other.append(error)
        return ticks

    with ThreadPoolExecutor(2) as pool:
        ticks = sum(pool.map(hammer, (1.0, -1.0)))
    assert not other
    assert ticks > 100
    assert controller.time == pytest.approx(0.001 * ticks)
    assert np.isfinite([controller.position, controller.acceleration]).all()


def test_a_thread_may_reset_what_another_steps(model: pdmp.Model) -> None:
    """After concurrent resets the controller is finite and usable."""
    controller = model.controller(0.001)
    stop = threading.Event()

    def step() -> None:
        while not stop.is_set():
            controller.step()

    with ThreadPoolExecutor(1) as pool:
        stepping = pool.submit(step)
        for k in range(2000):
            controller.reset(tau=0.5 + k / 2000)
        stop.set()
        stepping.result()
    controller.reset()
    alone = model.controller(0.001)
    assert controller.step() == alone.step()
    np.testing.assert_array_equal(controller.position, alone.position)


def test_a_tick_within_a_tick_is_rejected(reach: pdmp.Model) -> None:
    """An argument that steps its own controller raises an error in the inner tick only."""
    controller = reach.controller(0.001)

    class Measured:
        def __array__(self, dtype: object = None, copy: object = None) -> np.ndarray:
            controller.step()
            return np.zeros(2)

    with pytest.raises((RuntimeError, ValueError), match="borrowed"):
        controller.step(measured=Measured())
    assert controller.time == 0
    controller.step()
    assert controller.time == 0.001


def test_controllers_in_threads_move_as_one_by_one(model: pdmp.Model) -> None:
    """Controllers of one model in threads move as they do one by one, bit for bit."""

    def move(k: int) -> np.ndarray:
        controller = model.controller(0.01, style=[0.1 * k, -0.1])
        path = []
        for tick in range(200):
            if tick == 50:
                controller.style = [-0.1, 0.05 * k]
            controller.step()
            path.append(controller.position.copy())
        return np.array(path)

    expected = [move(k) for k in range(8)]
    with ThreadPoolExecutor(8) as pool:
        np.testing.assert_array_equal(list(pool.map(move, range(8))), expected)


class Clock:
    """Simulated clock that advances only by sleep and work."""

    def __init__(self) -> None:
        self.now = 1000.0
        self.slept: list[float] = []

    def work(self, seconds: float) -> None:
        """Advances by a time."""
        self.now += seconds

    def sleep(self, seconds: float) -> None:
        """Advances by the time asleep and a small delay."""
        self.slept.append(seconds)
        self.now += seconds + 60e-6


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """Replaces the clock of paced loops by a simulated one."""
    clock = Clock()
    monkeypatch.setattr(realtime, "perf_counter", lambda: clock.now)
    monkeypatch.setattr(realtime, "sleep", clock.sleep)
    return clock


def test_paced_loop_is_the_repeated_step(model: pdmp.Model, clock: Clock) -> None:
    """Without delays, tick k is at start + k / rate without drift, and moves as step does."""
    controller, alone = model.controller(), model.controller()
    start = clock.now
    for k, tick in enumerate(pdmp.PacedLoop(controller, rate_hz=1000, duration=0.7), 1):
        alone.step()
        np.testing.assert_array_equal(controller.position, alone.position)
        assert (tick.time, tick.missed) == (k / 1000, 0)
        assert clock.now - start == pytest.approx(tick.time + tick.lateness)
        assert tick.lateness == pytest.approx(60e-6)
        clock.work(0.4e-3)
    assert k == 700


def test_discrete_movements_end_as_they_finish(reach: pdmp.Model, clock: Clock) -> None:
    """The last tick is FINISHED; the default rate is that of the controller."""
    controller, alone = reach.controller(0.01), reach.controller(0.01)
    ticks = sum(1 for _ in pdmp.PacedLoop(controller))
    expected = 1
    while alone.step() == Status.WORKING:
        expected += 1
    assert ticks == expected
    assert controller.time == pytest.approx(clock.now - 1000, abs=1e-4)


def test_a_goal_set_in_the_last_tick_is_reached(reach: pdmp.Model, clock: Clock) -> None:
    """A command in the body of the last tick continues the loop."""
    controller = reach.controller(0.01)
    goals = [[2, 1], [0.5, 0]]
    for _ in pdmp.PacedLoop(controller):
        if controller.status == Status.FINISHED and goals:
            controller.goal = goals.pop()
    assert not goals
    np.testing.assert_allclose(controller.position, [2, 1], atol=5e-3)


def test_a_duration_can_exceed_the_movement(reach: pdmp.Model, clock: Clock) -> None:
    """A loop with a duration stays at the goal, and moves to a new one."""
    controller = reach.controller(0.01)
    for tick in pdmp.PacedLoop(controller, duration=10):
        if tick.time > 5:
            controller.goal = [2, 1]
    assert controller.time == pytest.approx(10)
    np.testing.assert_allclose(controller.position, [2, 1], atol=5e-3)


def test_late_ticks_catch_up_with_the_clock(reach: pdmp.Model, clock: Clock) -> None:
    """Missed deadlines are reported, caught up in one step, and do not shift later ones."""
    controller = reach.controller()
    run = pdmp.PacedLoop(controller, rate_hz=1000, duration=0.5, late="catch up")
    missed, late = [], []
    for k, tick in enumerate(run):
        assert controller.time == pytest.approx(tick.time)
        assert clock.now - 1000 == pytest.approx(tick.time, abs=1e-3)
        missed.append(tick.missed)
        late.append(tick.lateness)
        clock.work({10: 0.9e-3, 100: 3.5e-3, 200: 42.25e-3}.get(k, 0.1e-3))
    assert {k: n for k, n in enumerate(missed) if n} == {101: 2, 201: 41}
    assert late[101] == pytest.approx(2.62e-3)
    assert late[102] == pytest.approx(60e-6)
    assert (run.ticks, run.missed, run.max_lateness) == (len(missed), 43, max(late))
    assert run.ticks + run.missed == 500


def test_a_movement_waits_for_a_late_tick(reach: pdmp.Model, clock: Clock) -> None:
    """By default every tick has one period, and the remaining deadlines are delayed."""
    controller, alone = reach.controller(), reach.controller()
    run = pdmp.PacedLoop(controller, rate_hz=1000, duration=0.5)
    for k, tick in enumerate(run):
        alone.step()
        np.testing.assert_array_equal(controller.position, alone.position)
        assert tick.missed == (41 if k == 201 else 0)
        clock.work(42.25e-3 if k == 200 else 0.1e-3)
    assert (run.ticks, run.missed) == (500, 41)
    assert clock.now - 1000 == pytest.approx(0.541, abs=1e-3)


def test_a_controller_runs_in_one_loop_at_a_time(reach: pdmp.Model, clock: Clock) -> None:
    """A second loop is rejected only while the first runs."""
    controller = reach.controller()
    first = iter(pdmp.PacedLoop(controller, duration=0.1))
    next(first)
    with pytest.raises(RuntimeError, match="runs in another loop"):
        next(iter(pdmp.PacedLoop(controller, duration=0.1)))
    next(iter(pdmp.PacedLoop(reach.controller(), duration=0.1)))
    first.close()  # type: ignore[attr-defined]
    assert sum(1 for _ in pdmp.PacedLoop(controller, duration=0.1)) == 100

    async def twice() -> None:
        """Leaves one loop and begins the next immediately."""
        for _ in range(2):
            async for _ in pdmp.PacedLoop(controller, rate_hz=500, duration=60):
                break

    monkeypatched = realtime.perf_counter
    realtime.perf_counter = time.perf_counter
    try:
        asyncio.run(twice())
    finally:
        realtime.perf_counter = monkeypatched


def test_each_kind_has_its_centre_alone(model: pdmp.Model) -> None:
    """A discrete movement has a goal, a rhythmic one an anchor, and a description of the other."""
    controller = model.controller(dt=0.01)
    own, other = ("goal", "anchor") if model.kind == "discrete" else ("anchor", "goal")
    assert hasattr(controller, own)
    assert not hasattr(controller, other)
    with pytest.raises(AttributeError, match=f"has no {other}; it has an? {own}"):
        getattr(controller, other)


def test_status_is_true_while_the_movement_continues(reach: pdmp.Model) -> None:
    """`while controller.step()` runs to the end; the values are those of the C interface."""
    controller = reach.controller()
    ticks = 0
    while controller.step():
        ticks += 1
    assert controller.status is pdmp.Status.FINISHED
    assert ticks > 100
    assert (int(pdmp.Status.WORKING), int(pdmp.Status.FINISHED)) == (1, 2)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copy_continues_bit_for_bit_and_independently(model: pdmp.Model, copied: Any) -> None:
    """A copy continues like the original, which it does not affect."""
    controller, alone = model.controller(), model.controller()
    for each in (controller, alone):
        for _ in range(100):
            each.step(measured=each.position - 0.01)
        each.tau = 0.7 * each.tau
        each.style = 0.5 * each.style
        each.step()
    ahead = copied(controller)
    before = controller.position.copy()
    for _ in range(300):
        alone.step()
        ahead.step()
        np.testing.assert_array_equal(ahead.position, alone.position)
        np.testing.assert_array_equal(ahead.acceleration, alone.acceleration)
    np.testing.assert_array_equal(controller.position, before)
    assert (ahead.phase, ahead.time) == (alone.phase, alone.time)


def test_speed_zero_pauses_on_the_path(model: pdmp.Model) -> None:
    """A pause stays at a point of the path, and the movement continues from there."""
    free, paused = model.controller(), model.controller()
    for _ in range(200):
        free.step()
        paused.step()
    paused.speed = 0
    for _ in range(20_000):
        paused.step()
    place, phase = paused.position.copy(), paused.phase
    paused.step(coupling=(np.ones_like(place), np.ones_like(place)))
    np.testing.assert_array_equal(paused.position, place)
    np.testing.assert_array_equal(paused.velocity, 0 * place)
    paused.speed = 1
    while abs(free.phase - phase) > 1e-12:
        ahead = copy.copy(free)
        ahead.step()
        if (ahead.phase - phase) * np.sign(free.phase - phase) < 0 or ahead.phase == phase:
            low, high = 0.0, 0.001
            for _ in range(60):
                middle = (low + high) / 2
                ahead = copy.copy(free)
                ahead.step(middle)
                past = (ahead.phase - phase) * np.sign(free.phase - phase) < 0
                low, high = (low, middle) if past else (middle, high)
            free = ahead
            break
        free.step()
    np.testing.assert_allclose(free.position, place, atol=1e-8)
    for _ in range(500):
        paused.step()
    assert abs(paused.phase - phase) > 1e-3
    for bad in (-0.1, np.nan, np.inf):
        with pytest.raises(ValueError, match="speed"):
            paused.speed = bad


@pytest.mark.parametrize("speed", [0.5, 2.0])
def test_speed_scales_the_rate_smoothly(model: pdmp.Model, speed: float) -> None:
    """A new speed scales the rate of the clock, and the velocity does not jump."""

    def clock() -> float:
        """Returns u or the polar phase."""
        phase = controller.phase
        return phase if model.alpha_x is None else float(-np.log(phase) / model.alpha_x)

    controller = model.controller()
    for _ in range(300):
        controller.step()
    peak = np.abs(model.rollout().velocity).max()
    controller.speed = speed
    for _ in range(1000):
        before = controller.velocity.copy()
        controller.step()
        assert np.abs(controller.velocity - before).max() <= 0.02 * max(speed, 1) * peak
    start = clock()
    controller.step()
    advance = (clock() - start) % (2 * np.pi)
    assert advance == pytest.approx(speed * controller.dt / model.tau, rel=1e-4)


def test_a_rhythmic_movement_starts_on_its_cycle_at_any_phase(reach: pdmp.Model) -> None:
    """A start at a phase has no transient."""
    s = np.arange(100) / 100 * 2 * np.pi
    cycles = [np.column_stack([a * np.sin(s), 0.3 * a * np.cos(2 * s)]) for a in (1, 1.2, 1.5)]
    model = pdmp.fit(cycles, dt=0.01, kind="rhythmic")
    whole = model.rollout(dt=1 / 1000, duration=1)
    for share in (250, 600, 999):
        phase = share / 1000 * 2 * np.pi
        for start in (model.controller(phase=phase), model.controller(phase=phase - 2 * np.pi)):
            assert start.phase == pytest.approx(phase)
            np.testing.assert_allclose(start.position, whole.position[share], atol=1e-8)
            np.testing.assert_allclose(start.velocity, whole.velocity[share], atol=1e-6)
        start.step()
        start.reset(phase=phase, amplitude=0.5)
        np.testing.assert_allclose(
            start.position - model.anchors[0],
            0.5 * (whole.position[share] - model.anchors[0]),
            atol=0.5,
        )
        turn = model.rollout(phase=phase, dt=1 / 1000, duration=1)
        np.testing.assert_allclose(turn.position[0], turn.position[-1], atol=1e-8)
    with pytest.raises(ValueError, match="phase"):
        reach.controller(phase=1.0)
    with pytest.raises(ValueError, match="phase"):
        model.controller(phase=np.nan)


def test_an_amplitude_changes_as_smoothly_as_tau() -> None:
    """Halving the amplitude causes no larger jump of the acceleration than halving tau."""
    s = np.arange(100) / 100 * 2 * np.pi
    model = pdmp.fit([a * np.sin(s)[:, None] for a in (1, 1.5)], dt=0.01, kind="rhythmic")

    def jump(**command: float) -> float:
        """Returns the largest jump of the acceleration after a command."""
        controller = model.controller()
        for _ in range(1300):
            controller.step()
        for name, value in command.items():
            setattr(controller, name, value)
        samples = []
        for _ in range(200):
            samples.append(controller.acceleration.copy())
            controller.step()
        return float(np.abs(np.diff(samples, axis=0)).max())

    assert jump(amplitude=0.5) < 2 * jump(tau=model.tau / 2)


def test_a_body_that_is_always_late_misses_and_does_not_burst(
    reach: pdmp.Model, clock: Clock
) -> None:
    """With 2.5 periods per tick, the number of ticks is that which fits into the time."""
    run = pdmp.PacedLoop(reach.controller(), rate_hz=1000, duration=1, late="catch up")
    for _ in run:
        clock.work(2.5e-3)
    assert run.ticks == pytest.approx(400, abs=20)
    assert run.ticks + run.missed == pytest.approx(1000, abs=3)
    assert min(clock.slept) >= 0


def test_commands_of_the_body_act_on_the_next_tick(reach: pdmp.Model, clock: Clock) -> None:
    """A goal set in the body of tick k acts in step k + 1."""
    controller, alone = reach.controller(), reach.controller()
    for k, _ in enumerate(pdmp.PacedLoop(controller, duration=0.3)):
        alone.step()
        np.testing.assert_array_equal(controller.position, alone.position)
        if k == 100:
            controller.goal = alone.goal = [0.7, 0.3]


def test_measured_and_coupling_are_called_before_each_tick(reach: pdmp.Model, clock: Clock) -> None:
    """The results of measured and coupling, None included, are passed to step."""
    controller, alone = reach.controller(), reach.controller()
    places = [None if k % 3 else np.array([0.01 * k, 0.1]) for k in range(50)]
    terms = [None if k % 2 else ([0, 0.1], [0.01 * k, 0]) for k in range(50)]
    places_left, terms_left = iter(places), iter(terms)
    asked = {"measured": lambda: next(places_left), "coupling": lambda: next(terms_left)}
    for k, _ in enumerate(pdmp.PacedLoop(controller, duration=0.05, **asked)):
        alone.step(measured=places[k], coupling=terms[k])
        np.testing.assert_array_equal(controller.acceleration, alone.acceleration)


@pytest.mark.parametrize("error", [KeyboardInterrupt, LookupError])
@pytest.mark.parametrize("place", ["body", "measured", "sleep"])
def test_interrupted_loops_leave_the_controller_between_two_ticks(
    reach: pdmp.Model,
    clock: Clock,
    monkeypatch: pytest.MonkeyPatch,
    error: type[BaseException],
    place: str,
) -> None:
    """An exception from any part of the loop propagates, and the movement can continue."""
    controller = reach.controller()
    trouble = False

    def guard(here: str) -> None:
        if trouble and here == place:
            raise error

    def asleep(seconds: float) -> None:
        guard("sleep")
        clock.sleep(seconds)

    monkeypatch.setattr(realtime, "sleep", asleep)
    run = pdmp.PacedLoop(controller, measured=lambda: guard("measured"))
    with pytest.raises(error):
        for tick in run:
            trouble = tick.time > 0.0095
            guard("body")
    assert (run.ticks, controller.time) == (10, pytest.approx(0.01))
    trouble = False
    clock.work(7)  # while nothing runs is not missed by the next loop
    for _ in run:
        if run.ticks == 20:
            break
    assert (run.missed, controller.time) == (0, pytest.approx(0.03))


def test_paced_loops_keep_real_time(reach: pdmp.Model) -> None:
    """On the system clock no tick is early, and the whole duration is covered."""
    controller = reach.controller()
    begin = time.perf_counter()
    run = pdmp.PacedLoop(controller, rate_hz=1000, duration=0.2, late="catch up")
    for tick in run:
        assert time.perf_counter() - begin >= tick.time
    assert run.ticks + run.missed >= 200
    assert controller.time == pytest.approx(tick.time)
    assert 0 <= tick.lateness <= run.max_lateness


def test_other_threads_run_while_a_loop_sleeps(reach: pdmp.Model) -> None:
    """A paced loop releases the interpreter between its ticks."""
    waited = threading.Event()
    done = threading.Event()

    def other() -> None:
        waited.wait()
        done.set()

    thread = threading.Thread(target=other)
    thread.start()
    run = pdmp.PacedLoop(reach.controller(), rate_hz=100, duration=60)
    for _ in run:
        waited.set()
        if done.is_set():
            break
    thread.join()
    assert run.ticks < 6000


def test_tasks_run_beside_an_asynchronous_loop(reach: pdmp.Model) -> None:
    """`async for` makes the same ticks, and other tasks run between them."""
    controller, alone = reach.controller(), reach.controller()
    served = 0

    async def serve() -> None:
        nonlocal served
        while True:
            served += 1
            await asyncio.sleep(0)

    async def main() -> pdmp.PacedLoop:
        task = asyncio.create_task(serve())
        run = pdmp.PacedLoop(controller, rate_hz=200, duration=0.2)
        ticks = 0
        async for _ in run:
            ticks += 1
            alone.step(1 / 200)
            assert served >= ticks
            np.testing.assert_array_equal(controller.position, alone.position)
        task.cancel()
        assert ticks == run.ticks
        return run

    run = asyncio.run(main())
    assert run.ticks + run.missed >= 40


def test_a_cancelled_loop_leaves_the_controller_usable(reach: pdmp.Model) -> None:
    """A cancelled task ends between two ticks."""
    controller = reach.controller()

    async def follow() -> None:
        async for _ in pdmp.PacedLoop(controller, rate_hz=500, duration=60):
            pass

    async def main() -> None:
        task = asyncio.create_task(follow())
        await asyncio.sleep(0.05)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(main())
    before = controller.time
    controller.step()
    assert controller.time == pytest.approx(before + 0.001)


BAD: list[tuple[dict[str, Any], str]] = [
    *(
        ({name: bad}, f"{name} = {bad!r}: must be a number between 1e-9 and 1e9")
        for name in ("rate_hz", "duration")
        for bad in (0, -1, NAN, INF, 1e-320, 1e300, "fast", [1000])
    ),
    ({"rate_hz": 100, "duration": 0.001}, "duration = 0.001: must be at least one period, 0.01 s"),
    ({"measured": [0, 0]}, "measured must be a function, called before each tick"),
    ({"coupling": ([0, 0], [0, 0])}, "coupling must be a function, called before each tick"),
]


@pytest.mark.parametrize(("given", "message"), BAD, ids=str)
def test_invalid_arguments_are_rejected_at_the_call(
    reach: pdmp.Model, given: dict[str, Any], message: str
) -> None:
    """Invalid arguments are rejected at construction."""
    with pytest.raises(ValueError) as error:
        pdmp.PacedLoop(reach.controller(), **given)
    assert message in str(error.value)


def test_scalars_of_numpy_are_rates(reach: pdmp.Model) -> None:
    """Scalars of numpy are valid rates."""
    for number in (np.int64(100), np.float32(100)):
        assert next(iter(pdmp.PacedLoop(reach.controller(), number))).time > 0
