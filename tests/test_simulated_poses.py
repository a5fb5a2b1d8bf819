"""Simulated robots follow primitives of poses, and hold a box between two hands."""

from importlib.util import find_spec

import numpy as np
import pytest

import pdmp
from poses import box, panda
from reproduction.baxter import mjcf


@pytest.fixture(scope="module", autouse=True)
def simulation() -> None:
    """Skips without mink and the models of the robots."""
    if find_spec("mink") is None:
        pytest.skip("mink not installed")
    try:
        mjcf()
    except ImportError as reason:
        pytest.skip(str(reason))


@pytest.fixture(scope="module")
def carried() -> dict[str, box.Record]:
    """Returns runs with a held arm, with the measured absolute pose and without."""
    demos, *spread = box.demonstrations(0)
    assert spread[0] > 0.005 and spread[1] > 0.02
    model = pdmp.fit(demos)
    conditions = model.conditions(box.SHOWN)
    runs = {"closed": True, "open": False}
    return {
        name: box.carry(model, conditions, closed=closed, held=True)
        for name, closed in runs.items()
    }


def test_commanded_grasp_is_rigid(carried: dict[str, box.Record]) -> None:
    """The relative pose of the commands does not change, also while the arm is held."""
    for record in carried.values():
        relative = record.rows("commanded")[:, 7:]
        apart, angle = box.deviation(relative, relative[0])
        assert apart.max() < 1e-12 and angle.max() < 1e-12


def test_box_is_held_while_the_movement_waits(carried: dict[str, box.Record]) -> None:
    """With the measured pose, both pads press on the box all the time, and it hardly slips."""
    record = carried["closed"]
    assert record.rows("force").min() > 10
    assert not any(record.others)
    offset, turn = box.in_frame(record.rows("box"), record.rows("measured")[:, :7])
    assert offset.max() < 0.008 and turn.max() < np.radians(8)
    commanded, measured = record.rows("commanded"), record.rows("measured")
    apart, angle = box.deviation(measured[-1, :7], commanded[-1, :7])
    assert apart < 0.003 and angle < 0.02
    # The box is in the air.
    assert record.box[-1][2] > box.START[2] + 0.03


def test_measured_pose_spares_the_grasp(carried: dict[str, box.Record]) -> None:
    """Without it, the held arm and the other one are pulled apart."""
    strains = {}
    for name, record in carried.items():
        relative = record.rows("measured")[:, 7:]
        strains[name] = box.deviation(relative, relative[0])[0].max()
    assert strains["open"] > 2 * strains["closed"]
    assert len(carried["closed"].commanded) > 1.2 * len(carried["open"].commanded)


@pytest.mark.parametrize(("task", "largest"), [("openbox", 1e-3), ("sink", 2.5e-3)])
def test_tool_of_a_panda_follows_recorded_poses(task: str, largest: float) -> None:
    """Tracking errors are below 1 or 2.5 mm, and 0.1°: the recorded path of `sink` has jumps."""
    demos = panda.tasks().get(task)
    if demos is None:
        pytest.skip("the recordings are not below PDMP_DATA")
    model = pdmp.fit(demos)
    _, record = panda.run(model, model.conditions(2), panda.NEAR[task], closed=True, held=False)
    commanded, measured = record.rows("commanded"), record.rows("measured")
    apart, angle = box.deviation(measured, commanded)
    assert apart.max() < largest and angle.max() < np.radians(0.1)
    # The movement ends where the demonstrations end.
    apart, angle = box.deviation(commanded[-1], demos[2].position[-1])
    assert apart < 1e-3 and angle < 1e-2
