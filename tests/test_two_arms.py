"""Absolute and relative pose of two arms, and primitives that hold an object between them."""

import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import pdmp
from pdmp.robots import absolute_relative, left_right, mean_pose

FACING = [0.0, 1.0, 0.0, 0.0]
NUMBERS = st.floats(-2, 2)
POSES = st.tuples(*[NUMBERS] * 3, *[st.floats(-1, 1)] * 4).filter(
    lambda numbers: np.linalg.norm(numbers[3:]) > 0.1
)


def pose(numbers: tuple[float, ...]) -> np.ndarray:
    """Returns a pose (7,) whose quaternion has the norm 1."""
    position, quaternion = np.split(np.array(numbers), [3])
    return np.concatenate([position, quaternion / np.linalg.norm(quaternion)])


def rotation(poses: np.ndarray) -> Rotation:
    """Returns the rotations of poses."""
    return Rotation.from_quat(poses[..., 3:], scalar_first=True)


def gap(poses: np.ndarray, others: np.ndarray) -> float:
    """Returns the largest distance [m] or angle [rad] between poses."""
    apart = np.abs(poses[..., :3] - others[..., :3]).max()
    turned = (rotation(poses).inv() * rotation(others)).as_rotvec()
    return float(max(apart, np.abs(turned).max()))


def grasps(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Returns the poses of the right arm in the frame of the left one."""
    back = rotation(left).inv()
    turned = (back * rotation(right)).as_quat(scalar_first=True)
    return np.concatenate([back.apply(right[..., :3] - left[..., :3]), turned], axis=-1)


@given(left=POSES, right=POSES)
def test_conversion_follows_its_definition(
    left: tuple[float, ...], right: tuple[float, ...]
) -> None:
    """Mean position, geodesic midpoint, and the difference in the absolute frame."""
    one, two = pose(left), pose(right)
    between = (rotation(one).inv() * rotation(two)).as_rotvec()
    if np.linalg.norm(between) > np.radians(174):
        return
    absolute, relative = absolute_relative(one, two)
    middle = rotation(one) * Rotation.from_rotvec(between / 2)
    np.testing.assert_allclose(absolute[:3], (one[:3] + two[:3]) / 2, atol=1e-15)
    assert np.abs((middle.inv() * rotation(absolute)).as_rotvec()).max() < 1e-13
    np.testing.assert_allclose(relative[:3], middle.inv().apply(two[:3] - one[:3]), atol=1e-13)
    np.testing.assert_allclose(rotation(relative).as_rotvec(), between, atol=1e-13)


@given(left=POSES, right=POSES)
def test_conversion_is_inverted(left: tuple[float, ...], right: tuple[float, ...]) -> None:
    """There and back, by the relative rotation as the reference where arms face each other."""
    one, two = pose(left), pose(right)
    reference = (rotation(one).inv() * rotation(two)).as_quat(scalar_first=True)
    parts = absolute_relative(one, two, reference=reference)
    again, other = left_right(*parts, reference=-reference)
    assert gap(one, again) < 1e-14 and gap(two, other) < 1e-14


def test_arms_that_face_each_other_need_a_reference() -> None:
    """The default names the rotation to pass, with which small motions remain small."""
    left = np.array([0, 0.2, 0, 1.0, 0, 0, 0])
    facing = Rotation.from_rotvec(np.radians(180) * np.array([1.0, 0, 0]))
    wobble = Rotation.from_rotvec(np.random.default_rng(0).normal(size=(50, 3)) * 0.02)
    right = np.tile([0, -0.2, 0, 0, 0, 0, 0.0], (50, 1))
    right[:, 3:] = (facing * wobble).as_quat(scalar_first=True)
    with pytest.raises(ValueError, match=r"row 0: right: .* pass a reference near \[-0\.0"):
        absolute_relative(left, right)
    absolute, relative = absolute_relative(left, right, reference=FACING)
    turned = Rotation.from_rotvec([np.radians(90), 0, 0])
    assert np.abs((turned.inv() * rotation(absolute)).as_rotvec()).max() < 0.05
    assert gap(left_right(absolute, relative, reference=FACING)[1], right) < 1e-14


def test_one_pose_serves_for_all() -> None:
    """A fixed grasp is one relative pose; shapes are those of the other argument."""
    random = np.random.default_rng(1)
    absolute = np.array([pose(tuple(row)) for row in random.normal(size=(12, 7))]).reshape(3, 4, 7)
    relative = pose((0.1, 0.4, 0, 1, 0.2, 0.1, 0))
    left, right = left_right(absolute, relative)
    assert left.shape == right.shape == (3, 4, 7)
    np.testing.assert_array_equal(left[1, 2], left_right(absolute[1, 2], relative)[0])
    assert (
        gap(grasps(left, right), np.broadcast_to(grasps(left[0, 0], right[0, 0]), left.shape))
        < 1e-14
    )


def test_mean_pose_is_that_of_scipy() -> None:
    """Arithmetic mean of positions; of rotations close together, that of their chords."""
    random = np.random.default_rng(2)
    poses = np.array([pose((*row, 1, *0.01 * row)) for row in random.normal(size=(9, 3))])
    mean = mean_pose(poses)
    np.testing.assert_allclose(mean[:3], poses[:, :3].mean(axis=0), atol=1e-15)
    assert np.abs((rotation(mean).inv() * rotation(poses).mean()).as_rotvec()).max() < 1e-5
    residuals = (rotation(mean).inv() * rotation(poses)).as_rotvec()
    np.testing.assert_allclose(residuals.sum(axis=0), 0, atol=1e-14)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda p: absolute_relative(p[:6], p),
            r"left has shape \[6\]: expected poses \(\.\.\., 7\)",
        ),
        (
            lambda p: left_right([p, p], [p] * 3),
            r"absolute has shape \[2, 7\] and relative has shape",
        ),
        (lambda p: left_right(p, 2 * p), r"relative\[3:7\] has norm 2\.?0*: a rotation is a unit"),
        (
            lambda p: absolute_relative(p, p * np.nan),
            r"right\[0\] = NaN: every number must be finite",
        ),
        (
            lambda p: left_right(p, p, reference=[1, 0, 0]),
            "reference has 3 numbers: expected a unit",
        ),
        (lambda p: left_right(p, p, reference=[0, 0, 0, 0]), r"reference\[0:4\] has norm 0"),
        (
            lambda p: left_right(p, p, reference=[0, 1, 0, 0]),
            "relative: the relative rotation .* 180",
        ),
        (lambda p: mean_pose(p[:3]), r"poses has shape \[3\]"),
        (lambda p: mean_pose(np.empty((0, 7))), "poses is empty"),
        (
            lambda p: mean_pose([p, p, [0, 0, 0, 0, 1, 0, 0]]),
            "poses has a rotation of more than 90",
        ),
    ],
)
def test_bad_poses_are_refused(call: Any, message: str) -> None:
    """The error names the argument and the numbers."""
    with pytest.raises(ValueError, match=message):
        call(np.array([0.0, 0, 0, 1, 0, 0, 0]))


# Primitives


def carried(seed: int, n_demos: int = 8) -> list[np.ndarray]:
    """Returns absolute poses (T, 7) of movements of an object, with turns of up to 120°."""
    random = np.random.default_rng(seed)
    s = np.linspace(0, 1, 101)[:, None]
    forward = s**3 * (10 - 15 * s + 6 * s**2)
    poses = []
    for _ in range(n_demos):
        goal, lift = random.normal(size=3) * 0.1 + [0.1, -0.4, 0.1], random.uniform(0.1, 0.3)
        position = goal * forward + np.sin(np.pi * s) ** 2 * [0, 0, lift]
        spin = Rotation.from_rotvec(forward * [0.3, 0.2, 2.0] + random.normal(size=3) * 0.2)
        sway = Rotation.from_rotvec(np.sin(np.pi * s) ** 2 * random.normal(size=3) * 0.3)
        poses.append(np.hstack([position, (spin * sway).as_quat(scalar_first=True)]))
    return poses


def two_arms(absolute: list[np.ndarray], relative: list[np.ndarray]) -> pdmp.Model:
    """Fits a primitive of absolute and relative pose; a constant pose is no noise."""
    demos = [
        pdmp.Demonstration(np.hstack(pair), dt=0.02, rotations={3: "wxyz", 10: "wxyz"})
        for pair in zip(absolute, relative, strict=True)
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return pdmp.fit(demos, n_styles=3)


@pytest.fixture(scope="module", params=["noisy hands", "rigid hands"])
def holding(request: pytest.FixtureRequest) -> pdmp.Model:
    """Returns a primitive of arms that face each other and hold an object.

    It is taught by noisy hands, whose relative pose is replaced by its mean, or by the rigid object
    itself, where the relative pose has rounding errors alone.
    """
    random, wave = np.random.default_rng(3), np.sin(np.pi * np.linspace(0, 3, 101))[:, None]
    noise = 0.003 if request.param == "noisy hands" else 0.0
    pairs = []
    for absolute in carried(4):
        hands = left_right(absolute, [0.01, -0.4, 0.02, *FACING], reference=FACING)
        noisy = [hand + wave * random.normal(size=7) * noise for hand in hands]
        for hand in noisy:
            hand[:, 3:] /= np.linalg.norm(hand[:, 3:], axis=1, keepdims=True)
        pairs.append(absolute_relative(*noisy, reference=FACING))
    absolute, relative = map(list, zip(*pairs, strict=True))
    if noise > 0:
        assert max(gap(each, np.tile(relative[0][0], (101, 1))) for each in relative) > 0.01
        relative = [np.tile(mean_pose(relative), (101, 1))] * len(pairs)
    return two_arms(absolute, relative)


def grasp_error(model: pdmp.Model, poses: np.ndarray) -> float:
    """Returns the largest change [m, rad] of the grasp of the hands along poses (T, 14)."""
    hands = left_right(poses[:, :7], poses[:, 7:], reference=FACING)
    taught = left_right(model.starts[0][:7], model.starts[0][7:], reference=FACING)
    grasp = grasps(*hands)
    return gap(grasp, np.broadcast_to(grasps(*taught), grasp.shape))


def goal_of(model: pdmp.Model, random: np.random.Generator) -> np.ndarray:
    """Returns a goal whose absolute pose is random, with the grasp of the model."""
    goal = np.array(model.goals[random.integers(model.n_demos)])
    goal[:3] += random.normal(size=3) * 0.3
    spin = Rotation.from_rotvec(random.normal(size=3) * 0.5)
    goal[3:7] = (spin * rotation(goal[:7])).as_quat(scalar_first=True)
    return goal


def test_fixed_grasp_is_kept_exactly_for_any_style_goal_and_tau(holding: pdmp.Model) -> None:
    """Rollouts far from the demonstrations hold the object to rounding."""
    random, worst, moved = np.random.default_rng(5), 0.0, 0.0
    for _ in range(100):
        moves = holding.rollout(
            style=holding.styles.mean(axis=0)
            + random.normal(size=3) * holding.styles.std(axis=0) * 3,
            goal=goal_of(holding, random),
            tau=holding.tau * random.uniform(0.3, 3),
        )
        worst = max(worst, grasp_error(holding, moves.position))
        moved = max(moved, gap(moves.position[:, :7], holding.rollout().position[-1:, :7]))
        assert np.abs(moves.velocity[:, 6:]).max() < 1e-11
    assert moved > 0.5
    assert worst < 1e-12


def test_fixed_grasp_is_kept_while_commands_change_and_the_object_is_blocked(
    holding: pdmp.Model,
) -> None:
    """With the measured absolute pose alone, the movement gives way and the grasp does not."""
    random, free = np.random.default_rng(6), holding.rollout(dt=0.002).position
    controller, poses = holding.controller(dt=0.002), []
    for tick in range(3000):
        if tick % 400 == 399:
            controller.goal = goal_of(holding, random)
            controller.style = holding.styles[random.integers(holding.n_demos)]
            controller.tau = holding.tau * random.uniform(0.5, 2)
        if tick % 800 < 400:
            # The object is held where it was; the relative pose counts as reached.
            at = poses[tick - tick % 800 - 1][:7] if tick >= 800 else free[0, :7]
            controller.step(measured=np.concatenate([at, controller.position[7:]]))
        else:
            controller.release()
            controller.step()
        poses.append(controller.position.copy())
    assert grasp_error(holding, np.array(poses)) < 1e-12
    assert gap(np.array(poses)[399, :7], free[400, :7]) > 0.05
