"""Fits of blocks of demonstrations: from functions and lists, partial fits and on a cluster."""

import pickle
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pdmp

N_DEMOS, SIZE = 37, 8


def recordings(noise: float = 0.0, seed: int = 1) -> list[pdmp.Demonstration]:
    """Returns reaches with four factors of variation and contexts."""
    random = np.random.default_rng(seed)
    demos = []
    for _ in range(N_DEMOS):
        a, b, start, goal = random.uniform(-1, 1, 4)
        s = np.linspace(0, 1, int(random.integers(160, 200)))[:, None]
        rise = s**3 * (10 - 15 * s + 6 * s**2)
        bends = a * np.sin(3 * np.pi * s * [1, 0.5]) + b * a * np.cos(2 * np.pi * s)
        position = start + (goal - start) * rise + bends * (s * (1 - s)) ** 2 * 16
        position = position + noise * random.normal(size=position.shape)
        demos.append(pdmp.Demonstration(position, dt=random.uniform(0.009, 0.011), context=[a, b]))
    return demos


def blocks_of(demos: list[Any], size: int = SIZE) -> list[list[Any]]:
    """Returns the demonstrations in blocks."""
    return [demos[k : k + size] for k in range(0, len(demos), size)]


def assert_equal(model: pdmp.Model, whole: pdmp.Model) -> None:
    """Asserts that two models are equal to rounding, predictions included."""
    assert model.n_styles == whole.n_styles
    np.testing.assert_array_equal(model.noise, whole.noise)
    np.testing.assert_array_equal(model.goals, whole.goals)
    np.testing.assert_allclose(model.styles, whole.styles, rtol=0, atol=1e-10)
    for m in (0, N_DEMOS - 1):
        own, other = (fit.rollout(fit.conditions(m)).position for fit in (model, whole))
        np.testing.assert_allclose(own, other, rtol=0, atol=1e-10)
    own, other = (fit.rollout(context=[0.2, 0.4]).position for fit in (model, whole))
    np.testing.assert_allclose(own, other, rtol=0, atol=1e-9)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_function_of_blocks_gives_the_model_of_all(noise: float) -> None:
    """The model of blocks is that of all demonstrations, and few passes are needed."""
    demos = recordings(noise)
    calls = 0

    def read() -> Iterator[list[pdmp.Demonstration]]:
        nonlocal calls
        calls += 1
        yield from blocks_of(demos)

    whole = pdmp.fit(demos)
    assert_equal(pdmp.fit(read), whole)
    assert calls == 3
    assert_equal(pdmp.fit(blocks_of(demos)), whole)
    assert_equal(pdmp.fit(lambda: (tuple(block) for block in blocks_of(demos, 5))), whole)


def test_arrays_and_functions_are_blocks() -> None:
    """Arrays (B, T, D) are blocks, and functions that return one."""
    demos = np.random.default_rng(2).normal(size=(12, 160, 2)).cumsum(axis=1)
    whole = pdmp.fit(demos, dt=0.01, smoothing=None)
    parts = [demos[:5], demos[5:]]
    for blocks in (parts, [partial(np.copy, part) for part in parts]):
        model = pdmp.fit(blocks, dt=0.01, smoothing=None)
        np.testing.assert_allclose(model.styles, whole.styles, rtol=0, atol=1e-9)


def test_partial_fits_are_added_to(tmp_path: Path) -> None:
    """A collection grows over sessions; its order of merging does not matter."""
    demos = recordings()
    blocks = blocks_of(demos)
    collection = pdmp.PartialFit(blocks[0])
    collection.save(tmp_path / "collection.safetensors")
    loaded = pdmp.PartialFit.load(tmp_path / "collection.safetensors")
    others = []
    for block in blocks[1:]:
        others.append(pickle.loads(pickle.dumps(loaded.empty())))
        others[-1].update(block)
    others[0].merge(others[1])
    for other in (others[0], *others[2:]):
        loaded.merge(other)
    assert (loaded.n_demos, loaded.n_dofs) == (N_DEMOS, 2)
    whole = pdmp.fit(demos, n_samples=loaded.n_samples)
    assert_equal(loaded.finish(blocks), whole)
    assert_equal(loaded.finish(iter(blocks_of(demos, 11))), whole)
    assert repr(loaded).startswith("PartialFit(kind='discrete', n_demos=37")


def test_files_of_models_and_partial_fits_are_told_apart(tmp_path: Path) -> None:
    """Each reader names what the other file holds, and the reader for it."""
    demos = recordings()[:5]
    pdmp.PartialFit(demos).save(tmp_path / "partial")
    pdmp.fit(demos).save(tmp_path / "model")
    with pytest.raises(pdmp.ModelFileError, match=r"a partial fit, .*\(pdmp.PartialFit.load\)$"):
        pdmp.load(tmp_path / "partial")
    with pytest.raises(pdmp.ModelFileError, match=r"a model, not a partial fit: .* \(pdmp.load\)$"):
        pdmp.PartialFit.load(tmp_path / "model")


def test_parts_of_the_second_pass_can_be_pickled() -> None:
    """Projection and styles are sent to other processes."""
    demos = recordings()
    collection = pdmp.PartialFit(demos, n_samples=170)
    factorised = collection.factorise(n_styles=3)
    projection = pickle.loads(pickle.dumps(factorised.projection))
    parts = [projection.styles(demos[20:], 20), projection.styles(demos[:20], 0)]
    model = factorised.finish([pickle.loads(pickle.dumps(part)) for part in parts])
    assert_equal(model, pdmp.fit(demos, n_samples=170, n_styles=3))
    assert parts[0].styles.shape == (17, 3)


def test_errors_name_the_argument_and_the_remedy() -> None:
    """Blocks that do not fit are refused, and exceptions of their source passed on."""
    demos = recordings()
    blocks = blocks_of(demos)
    with pytest.raises(ValueError, match="alignment needs all demonstrations at once"):
        pdmp.fit(blocks, alignment="warp")
    with pytest.raises(ValueError, match="n_styles needs all demonstrations at once"):
        pdmp.fit(blocks, n_styles="auto")
    with pytest.raises(ValueError, match="contexts does not apply to blocks"):
        pdmp.fit(blocks, contexts=np.zeros(N_DEMOS))
    with pytest.raises(ValueError, match="demo 9: position has 1 DoFs"):
        pdmp.fit([demos[:8], [demos[8], np.zeros((50, 1))]], dt=0.01)
    with pytest.raises(ValueError, match="blocks differ between the passes"):
        pdmp.PartialFit(demos).finish([demos[1:], demos[:1]])
    with pytest.raises(TypeError, match="blocks = None: expected a list or another iterable"):
        pdmp.PartialFit(demos).finish(None)
    with pytest.raises(TypeError, match="the function of blocks returned None: expected a list"):
        pdmp.fit(lambda: None)
    partial = pdmp.PartialFit(demos)
    with pytest.raises(ValueError, match="other is this partial fit: .* would count twice"):
        partial.merge(partial)
    assert partial.n_demos == len(demos)
    with pytest.raises(ValueError, match="other has other settings"):
        pdmp.PartialFit(demos).merge(pdmp.PartialFit(demos, n_samples=99))

    def broken() -> Iterator[list[pdmp.Demonstration]]:
        yield blocks[0]
        raise KeyError("disk")

    with pytest.raises(KeyError, match="disk"):
        pdmp.fit(broken)


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_passes_over_other_blocks_are_refused(noise: float) -> None:
    """Every pass reads the demonstrations of the first one: fewer, more, changed or in disorder."""
    rng = np.random.default_rng(7)
    positions = [demo.position for demo in recordings()]
    noisy = [position + noise * rng.standard_normal(position.shape) for position in positions]
    demos = [pdmp.Demonstration(position, dt=0.01) for position in noisy]
    changed = pdmp.Demonstration(1.01 * demos[5].position, dt=0.01)
    for others in (
        demos[:-1],
        [*demos, demos[0]],
        [*demos[:5], changed, *demos[6:]],
        [demos[1], demos[0], *demos[2:]],
    ):
        passes = iter([demos])

        def read(passes: Any = passes, others: Any = others) -> Any:
            return iter(blocks_of(next(passes, others)))

        with pytest.raises(ValueError, match="blocks differ between the passes"):
            pdmp.fit(read)


def test_progress_cancels_a_fit_of_blocks() -> None:
    """An exception of `progress` ends the fit."""

    def stop(stage: str, _: float) -> None:
        if stage == "factorise":
            raise TimeoutError

    with pytest.raises(TimeoutError):
        pdmp.fit(blocks_of(recordings()), progress=stop)


def recorded(first: int, last: int, marker: str = "") -> list[pdmp.Demonstration]:
    """Returns a block; the first call with a marker ends the process of the worker."""
    if marker and not Path(marker).exists():
        import os
        import signal

        Path(marker).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return recordings()[first:last]


def test_cluster_survives_the_loss_of_a_worker(tmp_path: Path) -> None:
    """The fit on two processes, one of which is killed, is that of one process."""
    distributed = pytest.importorskip("distributed")
    firsts = range(0, N_DEMOS, SIZE)
    marker = str(tmp_path / "killed")
    blocks = [
        partial(recorded, first, min(first + SIZE, N_DEMOS), marker if first == SIZE else "")
        for first in firsts
    ]
    whole = pdmp.fit(recordings(), n_samples=180)
    reported = []
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        model = pdmp.fit_distributed(
            blocks, client=client, n_samples=180, progress=lambda *report: reported.append(report)
        )
        assert_equal(model, whole)
        assert Path(marker).exists()
        assert reported[-1] == ("styles", 1.0)

        def stop(stage: str, _: float) -> None:
            raise TimeoutError(stage)

        with pytest.raises(TimeoutError, match="targets"):
            pdmp.fit_distributed(blocks, client=client, progress=stop)
        with pytest.raises(ValueError, match="blocks is empty"):
            pdmp.fit_distributed([], client=client)


def waiting(k: int, folder: Path) -> list[pdmp.Demonstration]:
    """Returns a demonstration as a block; those from the twelfth wait until they are released."""
    (folder / f"{k}.read").touch()
    while k >= 12 and not (folder / "released").exists():
        time.sleep(0.01)
    return recordings()[k : k + 1]


def test_an_exception_of_progress_cancels_the_tasks_of_a_cluster(
    tmp_path: Path, client: Any
) -> None:
    """Blocks are read in their order, none after the cancellation, and the cluster is free."""
    reported = []

    def stop(stage: str, fraction: float) -> None:
        reported.append((stage, fraction))
        raise TimeoutError(stage)

    blocks = [partial(waiting, k, tmp_path) for k in range(N_DEMOS)]
    with pytest.raises(TimeoutError, match="targets"):
        pdmp.fit_distributed(blocks, client=client, progress=stop)
    (tmp_path / "released").touch()
    n_tasks = count = 1
    while n_tasks and count < 1000:  # the running tasks end
        n_tasks = client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks))
        time.sleep(0.01)
        count += 1
    assert n_tasks == 0
    assert max(int(file.stem) for file in tmp_path.glob("*.read")) < N_DEMOS // 2
    assert reported == [("targets", 1 / N_DEMOS)]
    demos = recordings()
    model = pdmp.fit_distributed(blocks_of(demos), client=client, n_samples=180)
    assert_equal(model, pdmp.fit(demos, n_samples=180))

    def stop_at_styles(stage: str, _: float) -> None:
        if stage == "styles":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pdmp.fit_distributed(blocks_of(demos), client=client, progress=stop_at_styles)


def damaged(k: int, at: int, marker: Path | None = None) -> list[pdmp.Demonstration]:
    """Returns a block; one raises an exception, the first time unless there is a marker."""
    if k == at and (marker is None or marker.exists()):
        raise OSError(5, "damaged", "demos.npz")
    if k == at and marker is not None:
        marker.touch()
    return recordings()[SIZE * k : SIZE * (k + 1)]


@pytest.mark.parametrize("at", [0, 2])
def test_an_exception_of_a_block_names_it(tmp_path: Path, client: Any, at: int) -> None:
    """The exception keeps type and arguments, whenever it is raised; a note has the index."""
    for marker in (None, tmp_path / "read"):
        blocks = [partial(damaged, k, at, marker) for k in range(4)]
        with pytest.raises(OSError, match="damaged: 'demos.npz'") as raised:
            pdmp.fit_distributed(blocks, client=client, n_samples=180)
        assert (raised.value.errno, raised.value.filename) == (5, "demos.npz")
        assert raised.value.__notes__ == [f"Raised for blocks[{at}]."]
    others = [partial(np.zeros, (3, 160, 1)), blocks[1]]
    with pytest.raises(ValueError, match="position has 2 DoFs") as mixed:
        pdmp.fit_distributed(others, client=client, dt=0.01)
    assert mixed.value.__notes__ == ["Raised for blocks[1]."]
