"""Kinematics of an arm of the robot Baxter; the four joints of the paper of its seven are used.

The model is that of robosuite 1.5.2 (MIT licence), read from its wheel without an import, so that
its dependencies need not be installed.
"""

from __future__ import annotations

import os
import sys
from ctypes.util import find_library
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import pdmp

Array = NDArray[np.float64]

JOINTS = ("s0", "s1", "e0", "e1")
"""Three joints of the shoulder and one of the elbow, the paper's q1 to q4."""
DIRECTIONS = {"right": np.array([1.0, -1.0, 1.0, -1.0]), "left": np.array([-1.0, -1.0, -1.0, -1.0])}
"""q = direction · angle, so that the same q of both arms are mirror images.

Baxter's signs of the shoulder pitch and the elbow flexion are opposite to those of the paper. With
these signs the printed goal places the hand on a table in front of the body, with a swivel angle
within 15° of that of people; no other combination of signs does so within the joint limits.
"""
ACCELERATION = 5.0
"""Limit of the acceleration of each joint [rad/s²]; the maker publishes none."""
MOUTH = np.array([0.20, 0.0, 0.55])
"""Position of a mouth, below Baxter's screen [m]."""


def mjcf(robot: str = "baxter") -> Path:
    """Returns the path of the model file of a robot.

    Raises
    ------
    ImportError
        The wheel of robosuite is not installed.
    """
    package = find_spec("robosuite")
    if package is None or package.origin is None:
        raise ImportError(
            "the model of the robot is not installed: pip install --no-deps robosuite==1.5.2"
        )
    return Path(package.origin).parent / "models" / "assets" / "robots" / robot / "robot.xml"


def engine() -> Any:
    """Returns the module of MuJoCo.

    Raises
    ------
    ImportError
        MuJoCo is not installed, or the renderer in `MUJOCO_GL` is not available.
    """
    # MuJoCo selects its renderer when it is imported, by default one that needs a window.
    if sys.platform == "linux" and "DISPLAY" not in os.environ:
        os.environ.setdefault("MUJOCO_GL", _windowless())
    try:
        import mujoco
        import scipy  # noqa: F401
    except ModuleNotFoundError as missing:
        raise ImportError(
            f"the robot needs {missing.name}: pip install --group reproduction"
        ) from None
    except (AttributeError, ImportError, OSError, RuntimeError) as error:
        requested = os.environ.get("MUJOCO_GL", "")
        raise ImportError(
            f'MuJoCo cannot start with MUJOCO_GL="{requested}" ({error}): leave it unset'
        ) from None
    return mujoco


def specification(robot: str = "baxter") -> Any:
    """Returns the model of a robot as a `mujoco.MjSpec`, to which bodies can be added.

    Raises
    ------
    ImportError
        MuJoCo or the model is not installed.
    """
    return engine().MjSpec.from_file(str(mjcf(robot)))


def limits(*sides: str) -> pdmp.Limits:
    """Returns the limits of the joints of some arms, (4,) for each, with the signs of `DIRECTIONS`.

    Those of position and velocity are published, that of the acceleration is `ACCELERATION`.
    """
    published = pdmp.robots.REGISTRY["baxter"].limits(JOINTS)
    assert published.position is not None and published.velocity is not None
    ends = np.concatenate([DIRECTIONS[side] * published.position for side in sides], axis=1)
    velocity = np.tile(published.velocity, len(sides))
    return pdmp.Limits((ends.min(axis=0), ends.max(axis=0)), velocity, ACCELERATION)


class UnreachableError(ValueError):
    """A position that the arm does not reach within its joint limits."""


class Arm:
    """Kinematics of one arm with a straight wrist.

    Parameters
    ----------
    side : {"right", "left"}
        Side of the arm.
    """

    def __init__(self, side: str = "right") -> None:
        mujoco = engine()
        self._model = specification().compile()
        self._data: Any = mujoco.MjData(self._model)
        joints = [self._model.joint(f"{side}_{joint}") for joint in JOINTS]
        self._directions = DIRECTIONS[side]
        self._addresses = [joint.qposadr[0] for joint in joints]
        limits = self._directions * np.array([joint.range for joint in joints]).T
        self.lowest, self.highest = limits.min(axis=0), limits.max(axis=0)
        bodies = ("lower_shoulder", "lower_elbow", "hand")
        self._bodies = [self._model.body(f"{side}_{body}").id for body in bodies]
        self._kinematics = mujoco.mj_kinematics

    def positions(self, q: ArrayLike) -> Array:
        """Returns the positions (3, 3) [m] of shoulder, elbow and hand at angles q (4,) [rad]."""
        self._data.qpos[self._addresses] = self._directions * q
        self._kinematics(self._model, self._data)
        return np.array(self._data.xpos[self._bodies])

    def hands(self, path: ArrayLike) -> Array:
        """Returns the positions of the hand (T, 3) [m] along joint angles (T, 4) [rad]."""
        return np.array([self.positions(q)[2] for q in np.asarray(path)])

    def swivel(self, q: ArrayLike) -> float:
        """Returns the angle [rad] of the elbow about the line from shoulder to hand.

        It is zero if the plane of the arm contains the mouth, on the other side of that line, so
        that elbow flexion alone brings the hand to the mouth. People reach within some 5° of this
        angle (Kim, Miller, Byl, Abrams, Rosen, IEEE Transactions on Biomedical
        Engineering 59, 2012, 1770-1779, doi:10.1109/TBME.2012.2194489).
        """
        return _swivel(self.positions(q))

    def reach(self, hands: Array, swivels: Array, near: ArrayLike) -> Array:
        """Returns joint angles (T, 4) [rad] for paths of hand and elbow (inverse kinematics).

        They minimise the squares of the hand's distance [m] and of 0.2 m times the sine of half the
        swivel's error. Each optimisation starts from the previous solution, the first from `near`.

        Parameters
        ----------
        hands : (T, 3) array
            Path of the hand [m].
        swivels : (T,) array
            Swivel angles [rad], as from `swivel`.
        near : (4,) array_like
            Initial joint angles of the first optimisation.

        Raises
        ------
        UnreachableError
            A position that the arm does not reach within its joint limits.
        """
        from scipy.optimize import least_squares

        def residuals(q: Array, hand: Array, swivel: float) -> Array:
            positions = self.positions(q)
            return np.append(positions[2] - hand, 0.2 * np.sin(0.5 * (_swivel(positions) - swivel)))

        q, path = np.asarray(near, dtype=float), []
        for hand, swivel in zip(hands, swivels, strict=True):
            solution = least_squares(residuals, q, method="lm", xtol=1e-12, args=(hand, swivel))
            q = solution.x
            inside = np.all((self.lowest <= q) & (q <= self.highest))
            if not inside or np.linalg.norm(solution.fun) > 1e-6:
                position = np.round(hand, 3)
                raise UnreachableError(
                    f"hands: {position} m is out of reach with the elbow at {swivel:.2f} rad"
                )
            path.append(q)
        return np.array(path)


def _windowless() -> str:
    """Returns an available renderer; MuJoCo cannot be imported with one that is missing."""
    if find_library("EGL") and (find_library("OpenGL") or find_library("GL")):
        return "egl"
    return "osmesa" if find_library("OSMesa") else "disable"


def _swivel(positions: Array) -> float:
    shoulder, elbow, hand = positions
    axis = (hand - shoulder) / np.linalg.norm(hand - shoulder)
    away, out = shoulder - MOUTH, elbow - shoulder
    away, out = away - axis * (axis @ away), out - axis * (axis @ out)
    return float(np.arctan2(np.cross(away, out) @ axis, away @ out))
