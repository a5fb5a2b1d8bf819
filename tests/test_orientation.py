"""Conversions between representations of orientations."""

from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

import pdmp
from pdmp import preprocessing as pre

Array = NDArray[np.float64]
ORDERS = ("wxyz", "xyzw")
SEQUENCES = [
    a + b + c for letters in ("xyz", "XYZ") for a, b, c in product(letters, repeat=3) if a != b != c
]
UNIT = {"rad": 1.0, "deg": np.pi / 180}
angle = st.floats(-np.pi, np.pi)
vectors = st.tuples(*[st.floats(-6.0, 6.0)] * 3).map(np.array)


def skew(v: ArrayLike) -> Array:
    """Returns the matrix of the cross product with a vector."""
    x, y, z = np.asarray(v, float)
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def exponential(v: ArrayLike) -> Array:
    """Returns the rotation matrix exp([v]): the power series of v/256, squared eight times."""
    matrix, term = np.eye(3), np.eye(3)
    for k in range(1, 16):
        term = term @ skew(np.asarray(v, float) / 256) / k
        matrix = matrix + term
    for _ in range(8):
        matrix = matrix @ matrix
    return matrix


def elementary(axis: str, turn: float) -> Array:
    """Returns the rotation matrix of a turn about a coordinate axis."""
    return exponential(turn * np.eye(3)["xyz".index(axis.lower())])


def of_euler(angles: ArrayLike, sequence: str) -> Array:
    """Returns the rotation matrix of Euler angles in rad as a product of matrices."""
    a, b, c = (elementary(*pair) for pair in zip(sequence, np.asarray(angles, float), strict=True))
    return a @ b @ c if sequence.isupper() else c @ b @ a


def of_quaternion(q: ArrayLike, order: str) -> Array:
    """Returns the rotation matrix of a unit quaternion, written out."""
    w, x, y, z = np.roll(q, 1) if order == "xyzw" else np.asarray(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@given(vectors, st.sampled_from(ORDERS))
def test_rotation_vectors_are_exponentials(v: Array, order: Any) -> None:
    """Quaternions and matrices of a rotation vector are those of the matrix exponential."""
    q = pre.rotation_vectors_to_quaternions(v, order=order)
    np.testing.assert_allclose(of_quaternion(q, order), exponential(v), atol=1e-12)
    matrix = pre.quaternions_to_matrices(q, order=order)
    np.testing.assert_allclose(matrix, exponential(v), atol=1e-12)
    shortest = pre.quaternions_to_rotation_vectors(q, order=order)
    assert np.linalg.norm(shortest) <= np.pi + 1e-15
    np.testing.assert_allclose(exponential(shortest), exponential(v), atol=1e-12)


@given(vectors, st.sampled_from(ORDERS))
def test_matrices_and_quaternions_are_inverse(v: Array, order: Any) -> None:
    """A rotation matrix, also of half a turn, comes back from its quaternion."""
    matrix = exponential(v)
    q = pre.matrices_to_quaternions(matrix, order=order)
    assert abs(np.linalg.norm(q) - 1) < 1e-15
    np.testing.assert_allclose(pre.quaternions_to_matrices(q, order=order), matrix, atol=1e-12)


@pytest.mark.parametrize("axis", [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0, 0.8], [1, 1, 1]])
def test_half_turns_are_exact(axis: ArrayLike) -> None:
    """Half a turn about any axis, where w = 0, is found from the matrix 2aaᵀ − 1."""
    a = np.asarray(axis) / np.linalg.norm(axis)
    q = pre.matrices_to_quaternions(2 * np.outer(a, a) - np.eye(3), order="wxyz")
    np.testing.assert_allclose(abs(q[0]), 0, atol=1e-15)
    np.testing.assert_allclose(np.abs(q[1:] @ a), 1, atol=1e-15)


@given(vectors, st.floats(-10, 10), st.sampled_from(ORDERS), st.sampled_from(["rad", "deg"]))
def test_axes_and_angles_are_rotation_vectors(v: Array, turn: float, order: Any, unit: Any) -> None:
    """An axis of any length and an angle are the vector of the unit axis times the angle."""
    norm = np.linalg.norm(v)
    assume(norm > 1e-3)
    q = pre.axis_angles_to_quaternions(v, turn / UNIT[unit], unit=unit, order=order)
    expected = exponential(v / norm * turn)
    np.testing.assert_allclose(of_quaternion(q, order), expected, atol=1e-12)


@given(
    st.tuples(angle, angle, angle),
    st.sampled_from(SEQUENCES),
    st.sampled_from(ORDERS),
    st.sampled_from(["rad", "deg"]),
)
def test_euler_angles_are_products_of_elementary_rotations(
    angles: Any, sequence: str, order: Any, unit: Any
) -> None:
    """Sequences, about fixed and moving axes, are products of matrices, and come back."""
    given_angles = np.array(angles) / UNIT[unit]
    q = pre.euler_to_quaternions(given_angles, sequence, unit=unit, order=order)
    matrix = of_euler(angles, sequence)
    np.testing.assert_allclose(of_quaternion(q, order), matrix, atol=1e-12)
    second = angles[1] if sequence[0] == sequence[2] else angles[1] - np.pi / 2
    assume(abs(np.sin(second)) > 1e-6)
    again = pre.quaternions_to_euler(q, sequence, unit=unit, order=order) * UNIT[unit]
    np.testing.assert_allclose(of_euler(again, sequence), matrix, atol=1e-9)
    low, high = (0, np.pi) if sequence[0] == sequence[2] else (-np.pi / 2, np.pi / 2)
    assert low - 1e-12 <= again[1] <= high + 1e-12
    assert np.abs(again[[0, 2]]).max() <= np.pi + 1e-12


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_gimbal_lock_is_reported_and_keeps_the_rotation(sequence: str) -> None:
    """In gimbal lock a warning counts the samples, and the angles still give the rotation."""
    locks = (0, np.pi) if sequence[0] == sequence[2] else (-np.pi / 2, np.pi / 2)
    for lock in locks:
        angles = [[0.4, lock, 0.7], [0.5, lock, 0.7]]
        q = pre.euler_to_quaternions(angles, sequence, unit="rad", order="wxyz")
        with pytest.warns(UserWarning, match="gimbal lock in 2 samples, first in sample 0"):
            again = pre.quaternions_to_euler(q, sequence, unit="rad", order="wxyz")
        assert again[0, 2] == pytest.approx(again[1, 2], abs=1e-12)
        for found, given_angles in zip(again, angles, strict=True):
            expected = of_euler(given_angles, sequence)
            np.testing.assert_allclose(of_euler(found, sequence), expected, atol=1e-7)


@pytest.mark.parametrize("sequence", ["xyz", "ZYX", "zxz", "YXY"])
def test_euler_angles_have_no_jumps(sequence: str) -> None:
    """Angles that pass half turns and the bounds of the second angle come back as they were."""
    s = np.linspace(0, 1, 400)[:, None]
    start = [0.3, 0.9, -0.4]
    angles = start + s * [9.0, -5.0, 7.0] + 0.001
    q = pre.euler_to_quaternions(angles, sequence, unit="rad", order="xyzw")
    assert np.sum(q[1:] * q[:-1], axis=1).min() > 0.9
    again = pre.quaternions_to_euler(q, sequence, unit="rad", order="xyzw")
    np.testing.assert_allclose(again, angles, atol=1e-9)


def test_rotation_vectors_pass_half_turns() -> None:
    """Rotation vectors of several turns, and quaternions of any signs, come back as they were."""
    s = np.linspace(0, 1, 300)[:, None]
    v = np.array([0.6, 0.0, 0.8]) * (0.2 + 14 * s)
    q = pre.rotation_vectors_to_quaternions(v, order="wxyz")
    assert q[0, 0] > 0 and np.sum(q[1:] * q[:-1], axis=1).min() > 0.9
    flipped = q * np.where(np.random.default_rng(2).random(300) < 0.5, -1, 1)[:, None]
    again = pre.quaternions_to_rotation_vectors(flipped, order="wxyz")
    np.testing.assert_allclose(again, v, atol=1e-9)
    matrices = pre.quaternions_to_matrices(flipped, order="wxyz")
    np.testing.assert_allclose(pre.matrices_to_quaternions(matrices, order="wxyz"), q, atol=1e-14)


@given(vectors, st.tuples(*[st.floats(-1e-4, 1e-4)] * 9))
def test_rounded_matrices_become_the_closest_rotation(v: Array, noise: Any) -> None:
    """A matrix with small errors becomes its polar factor, the closest rotation."""
    matrix = exponential(v) + np.reshape(noise, (3, 3))
    u, _, vt = np.linalg.svd(matrix)
    q = pre.matrices_to_quaternions(matrix, order="wxyz")
    np.testing.assert_allclose(of_quaternion(q, "wxyz"), u @ vt, atol=1e-13)


@given(vectors, vectors, st.sampled_from(ORDERS))
def test_transforms_and_poses_are_inverse(v: Array, place: Array, order: Any) -> None:
    """A homogeneous transform comes back from its pose of position and quaternion."""
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = exponential(v), place
    pose = pre.transforms_to_poses(transform, order=order)
    np.testing.assert_array_equal(pose[:3], place)
    np.testing.assert_allclose(of_quaternion(pose[3:], order), exponential(v), atol=1e-12)
    np.testing.assert_allclose(pre.poses_to_transforms(pose, order=order), transform, atol=1e-12)


def test_poses_of_transforms_are_demonstrations() -> None:
    """Transforms along time become a demonstration, and rollouts become transforms."""
    s = np.linspace(0, 1, 80)
    m = s**3 * (10 - 15 * s + 6 * s**2)
    transforms = np.tile(np.eye(4), (80, 1, 1))
    transforms[:, :3, :3] = [exponential([0, 2.9 * x, 0.4 * x]) for x in m]
    transforms[:, 0, 3] = m
    poses = pre.transforms_to_poses(transforms, order="xyzw")
    demo = pdmp.Demonstration(poses, dt=0.02, rotations={3: "xyzw"})
    rollout = pdmp.fit([demo]).rollout(dt=0.02)
    again = pre.poses_to_transforms(rollout.position, order="xyzw")
    np.testing.assert_allclose(again, transforms, atol=1e-3)


def test_samples_and_series_have_matching_shapes() -> None:
    """One sample gives one, a series along time gives a series."""
    turns = pre.axis_angles_to_quaternions([0, 0, 1], [0.1, 0.2], unit="rad", order="wxyz")
    assert turns.shape == (2, 4)
    assert pre.quaternions_to_matrices(turns, order="wxyz").shape == (2, 3, 3)
    assert pre.quaternions_to_matrices(turns[0], order="wxyz").shape == (3, 3)
    assert pre.quaternions_to_rotation_vectors(turns[0], order="wxyz").shape == (3,)
    assert pre.rotation_vectors_to_quaternions(np.zeros((0, 3)), order="wxyz").shape == (0, 4)


MIRROR = np.diag([1.0, 1.0, -1.0])
TRANSPOSED = np.eye(4)
TRANSPOSED[3, 0] = 0.3
NAN = np.full((2, 3, 3), np.nan)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: pre.matrices_to_quaternions(1.01 * np.eye(3), order="wxyz"),
            r"matrices\[0\].*0.0201",
        ),
        (lambda: pre.matrices_to_quaternions(np.zeros((3, 3)), order="wxyz"), "identity by 1"),
        (lambda: pre.matrices_to_quaternions([np.eye(3), MIRROR], order="wxyz"), r"\[1\].*mirrors"),
        (lambda: pre.matrices_to_quaternions(NAN, order="wxyz"), "must be finite"),
        (lambda: pre.matrices_to_quaternions(np.eye(4), order="wxyz"), r"shape \(4, 4\), expected"),
        (lambda: pre.matrices_to_quaternions(np.eye(3), order="zyxw"), "order = 'zyxw'"),
        (lambda: pre.transforms_to_poses(TRANSPOSED, order="wxyz"), r"last row \[0.3, .*transpose"),
        (
            lambda: pre.axis_angles_to_quaternions([0, 0, 0], 1.0, unit="rad", order="wxyz"),
            r"axes\[0\] has norm 0",
        ),
        (
            lambda: pre.axis_angles_to_quaternions(np.eye(3), [1.0], unit="rad", order="wxyz"),
            "angles has length 1, expected 3",
        ),
        (lambda: pre.euler_to_quaternions([0, 0, 0], "xyZ", unit="rad", order="wxyz"), "'xyZ'"),
        (lambda: pre.euler_to_quaternions([0, 0, 0], "xxz", unit="rad", order="wxyz"), "twice"),
        (lambda: pre.euler_to_quaternions([0, 0, 0], "xyz", unit="turn", order="wxyz"), "unit ="),
        (lambda: pre.quaternions_to_matrices([1, 1, 0, 0], order="wxyz"), r"norm 1.41"),
        (lambda: pre.poses_to_transforms(np.ones((2, 6)), order="wxyz"), r"\(T, 7\) along time"),
    ],
)
def test_bad_orientations_are_refused(call: Any, message: str) -> None:
    """Wrong shapes, scales, reflections, axes and sequences are refused with the numbers."""
    with pytest.raises(ValueError, match=message):
        call()
