"""Robustness of the bindings: wrong lengths, shared arrays, endless recursion, forged files."""

import errno
import json
import struct
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pdmp
from pdmp._native import Model

S = np.linspace(0, 1, 51)
REACHES = [np.column_stack([S**2 * (3 - 2 * S), h * S * (1 - S)]) for h in (0.0, 0.3, 0.6)]


@pytest.fixture(scope="module")
def model() -> Model:
    """Returns a model of reaches of several heights."""
    return pdmp.fit(REACHES, dt=0.02, basis="ngnet", n_styles=2)


@pytest.mark.parametrize("length", [2**62, 2**40])
def test_a_wrong_length_is_rejected_by_name(model: Model, length: int) -> None:
    """No memory is reserved for a stated length; a wrong one is rejected."""
    lie: Any = range(length)
    calls: list[tuple[str, Callable[[], object]]] = [
        ("names", lambda: pdmp.Demonstration(REACHES[0], dt=0.02, names=lie)),
        ("units", lambda: pdmp.Demonstration(REACHES[0], dt=0.02, units=lie)),
        ("out", lambda: model.rollouts(style=model.styles, out=lie)),
    ]
    for name, call in calls:
        with pytest.raises((ValueError, TypeError), match=name):
            call()


def test_reshaping_a_motion_has_no_effect_elsewhere(model: Model) -> None:
    """Each access returns a new array over the same numbers, which can be reshaped separately."""
    controller = model.controller(0.001)
    first, second = controller.position, controller.position
    first.shape = (2, 1)
    controller.step()
    assert second.shape == controller.position.shape == (2,)
    assert np.array_equal(first[:, 0], second)
    with pytest.raises(ValueError, match="WRITEABLE"):
        second.flags.writeable = True


@pytest.mark.parametrize("name", ["goal", "style"])
def test_one_element_of_a_command_cannot_be_assigned(model: Model, name: str) -> None:
    """A command is read-only and can only be set as a whole."""
    controller = model.controller(0.001)
    with pytest.raises(ValueError, match="read-only"):
        getattr(controller, name)[0] = 1.0


def test_a_tick_of_length_zero_changes_nothing(model: Model) -> None:
    """A tick of length zero leaves status, time and motion unchanged."""
    controller = model.controller(0.001)
    for _ in range(100):
        controller.step()
    before = controller.position.copy(), controller.acceleration.copy(), controller.time
    assert controller.step(0.0) is pdmp.Status.WORKING
    assert np.array_equal(before[0], controller.position)
    assert np.array_equal(before[1], controller.acceleration)
    assert controller.time == before[2]


@pytest.mark.parametrize("transition", [5e-324, 1e-300, 1e-200, 1e-100, 1e-16, 1e-14])
def test_tiny_transitions_and_ticks_stay_finite(model: Model, transition: float) -> None:
    """Very short transitions and ticks give finite numbers."""
    controller = model.controller(0.001, transition=transition)
    for k, dt in enumerate([5e-324, 1e-300, 1e-100, 1e-15, 1e-3] * 4):
        controller.style = [0.1 * k, -0.2]
        controller.tau = 1.0 + 0.1 * k
        controller.step(dt, measured=[0.1, 0.2] if k % 2 else None)
        assert np.isfinite([controller.position, controller.velocity]).all()
        assert np.isfinite(controller.acceleration).all()


def test_outputs_that_overlap_themselves_are_rejected(model: Model) -> None:
    """An output array with overlapping elements is rejected."""
    shape = model.rollouts(style=model.styles, dt=0.1, derivatives=0)[0].shape
    out = np.lib.stride_tricks.as_strided(np.zeros(1), shape, (0, 0, 0))
    with pytest.raises(ValueError, match="share memory"):
        model.rollouts(style=model.styles, dt=0.1, derivatives=0, out=[out])
    slices = np.zeros((2 * shape[0], shape[1], 2 * shape[2]))[::2, :, ::-2]
    model.rollouts(style=model.styles, dt=0.1, derivatives=0, out=[slices])


def test_endless_recursion_is_an_exception() -> None:
    """Endless recursion through an array or a callback raises an exception."""

    class Endless:
        def __array__(self, *_: object, **__: object) -> object:
            return pdmp.factorise(self).styles  # type: ignore[arg-type]

    with pytest.raises((RecursionError, ValueError)):
        pdmp.factorise(Endless())  # type: ignore[arg-type]

    def fit(*_: object) -> None:
        pdmp.fit(REACHES, dt=0.02, progress=fit)

    with pytest.raises(RecursionError):
        fit()


def test_targets_are_copied_before_factorisation() -> None:
    """Targets are copied: later writes of other threads have no effect."""
    targets = np.random.default_rng(0).random((100, 2000))
    stop = threading.Event()

    def spoil() -> None:
        while not stop.wait(1e-4):
            targets[:] = np.nan
            targets[:] = 1.0

    thread = threading.Thread(target=spoil)
    thread.start()
    try:
        for _ in range(5):
            try:
                assert np.isfinite(pdmp.factorise(targets, n_styles=2).styles).all()
            except ValueError:
                continue
    finally:
        stop.set()
        thread.join()


def test_a_header_of_too_many_arrays_is_rejected_before_they_are_read() -> None:
    """A header with too many arrays is rejected before they are read."""
    entries = {f"a{k}": {"dtype": "F64", "shape": [0], "data_offsets": [0, 0]} for k in range(1000)}
    header = json.dumps(entries).encode()
    with pytest.raises(pdmp.ModelFileError, match="more arrays than any model"):
        Model.from_bytes(struct.pack("<Q", len(header)) + header)


def test_an_error_of_saving_keeps_its_number_and_leaves_no_draft(
    model: Model, tmp_path: Path
) -> None:
    """Errors of the operating system keep their errno in every step of saving."""
    (tmp_path / "folder").mkdir()
    for path, number in [
        (tmp_path / "absent" / "m", errno.ENOENT),
        (tmp_path / "folder", errno.EISDIR),
        (tmp_path / ("x" * 300), errno.ENAMETOOLONG),
    ]:
        with pytest.raises(OSError) as caught:
            model.save(path)
        assert caught.value.errno == number
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


def test_threads_that_save_on_one_path_leave_a_whole_model(model: Model, tmp_path: Path) -> None:
    """Each thread writes a separate temporary file."""
    path = tmp_path / "m.safetensors"
    threads = [threading.Thread(target=lambda: [model.save(path) for _ in range(5)]) for _ in "12"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert np.array_equal(pdmp.load(path).styles, model.styles)
    assert len(list(tmp_path.iterdir())) == 1
