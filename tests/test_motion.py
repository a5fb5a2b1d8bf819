"""Movements in Python: consistency of rollouts, controllers, batches, copies and files."""

import copy
import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp import Demonstration, Status
from synthetic import reaches

FIELDS = ("time", "position", "velocity", "acceleration")


def assert_same_motion(model: pdmp.Model, other: pdmp.Model) -> None:
    """Asserts that two models move equally bit for bit."""
    for name in FIELDS:
        made, expected = (getattr(m.rollout(style=[0.3, -0.2]), name) for m in (model, other))
        np.testing.assert_array_equal(made, expected)


def test_step_k_is_sample_k(model: pdmp.Model) -> None:
    """Step k of a controller equals sample k of the rollout, beyond the demonstrated end too."""
    conditions = {"style": [0.4, 0.1], "start": [0.2, 0.3], "velocity": [0.1, 0.0], "tau": 0.7}
    trajectory = model.rollout(dt=0.01, duration=3.0, **conditions)
    controller = model.controller(0.01, **conditions)
    for k, time in enumerate(trajectory.time):
        if k:
            controller.step()
        assert controller.time == pytest.approx(time, abs=1e-12)
        for name in FIELDS[1:]:
            expected = getattr(trajectory, name)[k]
            np.testing.assert_allclose(getattr(controller, name), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ["position", "velocity", "acceleration"])
def test_outputs_are_read_only_views(model: pdmp.Model, name: str) -> None:
    """Each output is a view of the same memory, which only a step can write."""
    controller = model.controller(0.01)
    view = getattr(controller, name)
    address, before = view.ctypes.data, view.copy()
    controller.step()
    assert getattr(controller, name).ctypes.data == view.ctypes.data == address
    assert not np.array_equal(view, before)
    with pytest.raises(ValueError, match="read-only"):
        view[0] = 1.0


def test_outputs_cannot_be_made_writable(model: pdmp.Model) -> None:
    """Views cannot be made writable."""
    position = model.controller(0.01).position
    with pytest.raises(ValueError, match="WRITEABLE"):
        position.setflags(write=True)
    assert not isinstance(position.base, np.ndarray)
    with pytest.raises(ValueError, match="resize"):
        position.resize(10**6, refcheck=False)


def test_trajectories_are_the_users_own(model: pdmp.Model) -> None:
    """Writing into a trajectory does not change later ones."""
    first = model.rollout()
    expected = first.position.copy()
    first.position[:] = np.nan
    np.testing.assert_array_equal(model.rollout().position, expected)


def test_objects_that_cannot_change_hand_out_read_only_arrays(model: pdmp.Model) -> None:
    """Assignment to an element would be lost, and is an error; a view made writable is a copy."""
    demo = pdmp.Demonstration(np.zeros((5, 2)), dt=0.1, goal=[1.0, 2.0], context=[3.0])
    conditions = model.conditions(0).replace(velocity=[0.1, 0.2])
    found = 0
    for holder in (model, demo, conditions, model.controller(0.01)):
        for name in dir(holder):
            if name.startswith("_") or name in ("goal", "anchor") and holder is not demo:
                continue
            array = getattr(holder, name)
            if isinstance(array, np.ndarray):
                found += 1
                expected = array.copy()
                with pytest.raises(ValueError, match="read-only"):
                    array[...] = np.nan
                np.testing.assert_array_equal(getattr(holder, name), expected)
    assert found > 20
    styles = model.styles
    styles.setflags(write=True)
    styles[:] = np.nan
    assert np.isfinite(model.styles).all()


def test_status_is_one_of_two_objects(reach: pdmp.Model) -> None:
    """A step returns members of Status, which `is`, `==` and dictionaries distinguish."""
    controller = reach.controller(0.01)
    assert controller.step() is Status.WORKING
    while controller.time < 5:
        status = controller.step()
    assert status is Status.FINISHED
    assert status == Status.FINISHED != Status.WORKING
    assert {Status.WORKING: 1, Status.FINISHED: 2}[status] == 2


def test_finished_movements_stay_finished(reach: pdmp.Model) -> None:
    """Without commands, no WORKING follows the first FINISHED."""
    controller = reach.controller(0.01)
    statuses = [controller.step() for _ in range(400)]
    first = statuses.index(Status.FINISHED)
    assert set(statuses[first:]) == {Status.FINISHED}


@pytest.mark.parametrize(
    "again", [copy.copy, copy.deepcopy, lambda m: pickle.loads(pickle.dumps(m))]
)
def test_copied_models_move_alike(model: pdmp.Model, again: Callable[[Any], Any]) -> None:
    """Copies and pickles of a model move equally bit for bit."""
    assert_same_motion(again(model), model)


@pytest.mark.parametrize("again", [copy.copy, lambda it: pickle.loads(pickle.dumps(it))])
def test_results_can_leave_a_process(again: Callable[[Any], Any]) -> None:
    """Trajectories, predictions and states are picklable."""
    model = pdmp.fit(reaches())
    results = {
        "time position velocity acceleration": model.rollout(),
        "duration covariance degrees_of_freedom extrapolation": model.predict([0.3]),
        "style goal start segment_durations": model.predict([0.3]).conditions,
    }
    for names, result in results.items():
        for name in names.split():
            np.testing.assert_array_equal(getattr(again(result), name), getattr(result, name))
    assert again(Status.FINISHED) == Status.FINISHED != again(Status.WORKING)


OBJECTS = [
    Demonstration(np.eye(5), dt=0.1, goal=[1, 2, 3, 4, 5], context=[0.5], names=list("abcde")),
    Demonstration(np.eye(5), time=[0, 1, 3, 4, 9.5]),
    Demonstration(np.eye(5)),
    pdmp.GP("matern32", length=0.25, noise=1e-6),
    pdmp.GP(),
    pdmp.NGnet(12),
    pdmp.NGnet(12, overlap=0.7),
]


@pytest.mark.parametrize("original", OBJECTS, ids=str)
@pytest.mark.parametrize("again", [copy.deepcopy, lambda o: pickle.loads(pickle.dumps(o))])
def test_copied_arguments_are_equal(original: Any, again: Callable[[Any], Any]) -> None:
    """Demonstrations and regressors survive copies and pickles in every attribute."""
    copied = again(original)
    names = [n for n in dir(original) if n[0] != "_" and not callable(getattr(original, n))]
    assert names
    for name in names:
        np.testing.assert_array_equal(getattr(copied, name), getattr(original, name))


def test_saved_models_move_alike(model: pdmp.Model, tmp_path: Path) -> None:
    """A loaded model is equal bit for bit, and saves the same file."""
    model.save(tmp_path / "a")
    loaded = pdmp.load(tmp_path / "a")
    assert_same_motion(loaded, model)
    loaded.save(tmp_path / "b")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_bytes_of_a_model_are_its_file(model: pdmp.Model, tmp_path: Path) -> None:
    """Bytes in memory equal the file, and both restore the model."""
    model.save(tmp_path / "model")
    assert model.to_bytes() == (tmp_path / "model").read_bytes()
    assert_same_motion(pdmp.Model.from_bytes(model.to_bytes()), model)


def test_bytes_that_are_cut_are_rejected(model: pdmp.Model) -> None:
    """Truncated bytes raise ModelFileError, like a damaged file."""
    for end in (0, 8, 100, -1):
        with pytest.raises(pdmp.ModelFileError):
            pdmp.Model.from_bytes(model.to_bytes()[:end])


@pytest.mark.parametrize("basis", ["gp", "ngnet"])
def test_table_error_is_stated_and_kept(basis: Any) -> None:
    """The table error is at most 1e-9 of the largest forcing for a fine table, and is saved."""
    model = pdmp.fit(reaches(), n_styles=2, basis=basis)
    assert 0 < model.table_error < 1e-9
    assert pdmp.Model.from_bytes(model.to_bytes()).table_error == model.table_error


@pytest.mark.parametrize("content", [b"", b"{}", b"not a model" * 99, b"\xff" * 64, None])
def test_damaged_files_are_distinct_from_other_errors(
    reach: pdmp.Model, tmp_path: Path, content: bytes | None
) -> None:
    """Garbage and truncated files raise ModelFileError, a PdmpError, with the path."""
    path = tmp_path / "model.safetensors"
    path.write_bytes(reach.to_bytes()[:-7] if content is None else content)
    with pytest.raises(pdmp.ModelFileError, match="model.safetensors") as error:
        pdmp.load(path)
    assert isinstance(error.value, pdmp.PdmpError)


def test_missing_files_are_missing_files(tmp_path: Path) -> None:
    """A missing path raises FileNotFoundError."""
    with pytest.raises(FileNotFoundError, match="none"):
        pdmp.load(tmp_path / "none")


def test_batch_is_written_in_place(model: pdmp.Model) -> None:
    """With `out`, positions and velocities are written into given arrays, strided ones too."""
    expected = model.rollouts(style=model.styles, dt=0.05)
    shape = expected[0].shape
    out = np.full(shape, np.nan), np.full((*shape[:2], 4), np.nan)[:, :, ::2]
    returned = model.rollouts(style=model.styles, dt=0.05, out=out)
    for mine, theirs, result in zip(out, returned, expected, strict=True):
        assert theirs is mine
        np.testing.assert_array_equal(mine, result)


def test_batch_is_the_rollouts_one_by_one(model: pdmp.Model) -> None:
    """Row b of a batch is the rollout of style b."""
    positions, velocities = model.rollouts(style=model.styles, dt=0.05, tau=1.5 * model.tau)
    for style, position, velocity in zip(model.styles, positions, velocities, strict=True):
        single = model.rollout(style=style, dt=0.05, tau=1.5 * model.tau)
        np.testing.assert_allclose(position, single.position, atol=1e-12)
        np.testing.assert_allclose(velocity, single.velocity, atol=1e-10)


@pytest.mark.parametrize("given", [{}, {"start": [0.1, 0.2]}, {"velocity": [0.5, -0.5]}], ids=str)
def test_jacobian_is_the_difference_of_rollouts(model: pdmp.Model, given: dict[str, Any]) -> None:
    """Finite differences of rollouts agree with the Jacobian, for all kinds of start."""
    jacobian = model.jacobian("style", dt=0.05, **given)
    style, h = np.array([0.3, -0.4]), 1e-3
    for j, step in enumerate(h * np.eye(2)):
        ahead, behind = (model.rollout(style=style + e, dt=0.05, **given) for e in (step, -step))
        difference = (ahead.position - behind.position) / (2 * h)
        np.testing.assert_allclose(jacobian[:, :, j], difference, atol=1e-9)


def test_threads_share_a_model(model: pdmp.Model) -> None:
    """Concurrent rollouts equal sequential ones."""
    styles = np.random.default_rng(0).normal(size=(40, 2))
    expected = [model.rollout(style=style).position for style in styles]
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(lambda style: model.rollout(style=style).position, styles))
    np.testing.assert_array_equal(made, expected)


def test_goal_of_a_model_at_rest_is_reached() -> None:
    """A model of demonstrations at rest still moves to a goal and finishes."""
    controller = pdmp.fit([np.ones((50, 2))] * 3, dt=0.01).controller(0.01)
    for _ in range(10):
        controller.step()
    controller.goal = [2.0, 3.3]
    ticks = 0
    while controller.step() == pdmp.Status.WORKING:
        ticks += 1
        assert ticks < 1000
    np.testing.assert_allclose(controller.position, [2.0, 3.3], atol=2e-3)


def test_reset_starts_as_the_nominal_demonstration() -> None:
    """Conditions omitted in reset are those of the nominal demonstration, not of commands."""
    model = pdmp.fit(reaches(), n_styles=2)
    controller = model.controller(style=[0.5, 0.1], tau=2.0)
    controller.step()
    controller.reset()
    assert (controller.tau, controller.time) == (model.tau, 0.0)
    np.testing.assert_array_equal(controller.style, model.styles[model.nominal])
