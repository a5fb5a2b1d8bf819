"""Baxter, which carries a box between its hands by a primitive of absolute and relative pose."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

import pdmp
from pdmp.robots import MujocoKinematics, absolute_relative, left_right, mean_pose
from poses.inverse import InverseKinematics
from reproduction.baxter import engine, specification
from reproduction.robot import WOOD, add_lights, disable_torso_contacts
from reproduction.torques import DT, TorqueControlled

SIDES = ("right", "left")
ANGLES = {"s0": -0.1, "s1": 0.1, "e0": 1.1, "e1": 1.4, "w0": 0.25, "w1": 1.15, "w2": -0.55}
"""Angles of the right arm [rad] near which its hand holds a box."""
MIRRORED = {"s0", "e0", "w0", "w2"}  # joints whose angles have the other sign in the left arm
JOINTS = [f"{side}_{name}" for side in SIDES for name in ANGLES]
NEAR = np.array(
    [
        -angle if side == "left" and name in MIRRORED else angle
        for side in SIDES
        for name, angle in ANGLES.items()
    ]
)
BOX = np.array([0.20, 0.34, 0.16])  # m; the hands hold it along y
MASS, FRICTION = 1.0, 1.0  # kg, –
IMPRATIO = 20.0  # of frictional to normal constraint impedance
PAD = 0.05, 0.01  # m, radius and half of the thickness of the pads of the hands
START = np.array([0.65, 0.10, 0.08, 1.0, 0.0, 0.0, 0.0])  # pose of the middle of the box
TABLE = np.array([0.60, 1.20, 0.04])  # m
FACING = np.array([0.0, -1.0, 0.0, 0.0])
"""Rotation from the left to the right pad, half a turn: with this reference, the absolute pose of
pads that hold the box is that of its middle."""
SHOWN = 3  # demonstration whose conditions the robot moves by
N_DEMOS, N_SAMPLES, DURATION = 12, 151, 3.0  # –, –, s
NOISE = 0.003, 0.01  # m, rad, of the hands that demonstrate
STIFFNESS, DAMPING = 3600.0, 120.0  # per s², per s; the wrists are light
SQUEEZE, OPEN = 0.008, 0.02  # m, by which pads are closer than the box is wide, or further apart
GRASP, WAIT = 0.6, 0.5  # s, to close the hands, and before and after the movement
MAX_TIME = 30.0  # s
HELD_JOINT, HELD = JOINTS.index("right_s1"), (1.4, 2.4)  # s, while a person holds the arm


def pads_of(width: float) -> np.ndarray:
    """Returns the relative pose (7,) of pads that face each other at a distance [m]."""
    return np.concatenate([[0.0, -width, 0.0], FACING])


def demonstrations(seed: int) -> tuple[list[pdmp.Demonstration], float, float]:
    """Returns movements of a box by two hands, and the spread of their relative pose [m, rad].

    Each hand has a slowly varying error. The relative poses of all samples are replaced by their
    mean, so that the primitive holds the box rigidly.
    """
    random, poses = np.random.default_rng(seed), []
    s = np.linspace(0, 1, N_SAMPLES)[:, None]
    # The box is lifted before it moves sideways.
    moving = np.clip((s - 0.12) / 0.76, 0, 1)
    forward, rise = (t**3 * (10 - 15 * t + 6 * t**2) for t in (moving, s))
    for _ in range(N_DEMOS):
        goal = np.array([0.62, -0.12, 0.15]) + random.uniform(-1, 1, 3) * [0.06, 0.06, 0.05]
        yaw, lift = random.uniform(-0.3, 0.2), random.uniform(0.10, 0.22)
        tilt = random.uniform(-0.3, 0.3)
        box = np.zeros((N_SAMPLES, 7))
        box[:, :3] = START[:3] + (goal - START[:3]) * np.hstack([forward, forward, rise])
        box[:, 2:3] += lift * np.sin(np.pi * s) ** 2
        half, side = 0.5 * yaw * forward, 0.5 * tilt * np.sin(np.pi * moving) ** 2
        box[:, 3:] = np.hstack(
            [
                np.cos(half) * np.cos(side),
                np.cos(half) * np.sin(side),
                np.sin(half) * np.sin(side),
                np.sin(half) * np.cos(side),
            ]
        )
        hands = []
        for hand in left_right(box, pads_of(BOX[1]), reference=FACING):
            wave = np.sin(np.pi * s * np.arange(1, 5)) @ random.normal(size=(4, 7)) / 2
            noisy = hand + wave * ([NOISE[0]] * 3 + [0.5 * NOISE[1]] * 4)
            noisy[:, 3:] /= np.linalg.norm(noisy[:, 3:], axis=1, keepdims=True)
            hands.append(noisy)
        poses.append(absolute_relative(*hands, reference=FACING))
    relative = np.concatenate([relative for _, relative in poses])
    mean = mean_pose(relative)
    off, angle = deviation(relative, mean)
    held = mean.copy()
    held[:3] *= (BOX[1] - SQUEEZE) / np.linalg.norm(held[:3])
    demos = [
        pdmp.Demonstration(
            np.hstack([absolute, np.tile(held, (N_SAMPLES, 1))]),
            dt=DURATION / (N_SAMPLES - 1),
            rotations={3: "wxyz", 10: "wxyz"},
        )
        for absolute, _ in poses
    ]
    return demos, float(off.max()), float(angle.max())


def deviation(poses: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns distances [m] and angles [rad] of poses (..., 7) from a pose (7,) or poses."""
    reference = np.asarray(reference)
    apart = np.linalg.norm(poses[..., :3] - reference[..., :3], axis=-1)
    # Twice the angle of the chord: exact for small angles, where the arc cosine is not.
    signs = np.where((poses[..., 3:] * reference[..., 3:]).sum(-1, keepdims=True) < 0, -1, 1)
    chord = np.linalg.norm(poses[..., 3:] - signs * reference[..., 3:], axis=-1)
    return apart, 4 * np.arcsin(np.minimum(0.5 * chord, 1.0))


def in_frame(poses: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the changes [m, rad] of poses (T, 7) in frames (T, 7) since the first row."""
    # The pose as that of the right arm, the frame as that of the left one.
    _, seen = absolute_relative(frames, poses)
    return deviation(seen, seen[0])


def robot() -> Any:
    """Returns the description of Baxter with a pad on each hand."""
    specified = specification()
    disable_torso_contacts(specified)
    cylinder = engine().mjtGeom.mjGEOM_CYLINDER
    radius, half = PAD
    for side in SIDES:
        hand = specified.body(f"{side}_hand")
        pad = hand.add_geom(name=f"{side}_pad", type=cylinder, size=[radius, half, 0], group=1)
        pad.pos, pad.rgba, pad.friction[0] = [0, 0, half], (0.2, 0.2, 0.2, 1), FRICTION
        pad.mass = 0.1
        # The pads are turned so that the wrists are near the middle of their range.
        hand.add_site(name=f"{side}_pad", pos=[0, 0, 2 * half], quat=[0, 0, 0, 1])
        # All contacts of the pad lie inside this site.
        volume = [1.1 * radius, 2 * half, 0]
        hand.add_site(name=f"{side}_touch", pos=[0, 0, half], type=cylinder, size=volume, group=4)
    return specified


def scene() -> Any:
    """Returns the description of the robot, a table and the box."""
    specified, box = robot(), engine().mjtGeom.mjGEOM_BOX
    add_lights(specified)
    top = START[:3] - [0, 0, 0.5 * BOX[2]]
    table = specified.worldbody.add_geom(
        name="table", type=box, size=0.5 * TABLE, rgba=WOOD, group=1
    )
    table.pos = [top[0] + 0.05, 0, top[2] - 0.5 * TABLE[2]]
    body = specified.worldbody.add_body(name="box", pos=START[:3], quat=START[3:])
    body.add_freejoint()
    cube = body.add_geom(name="box", type=box, size=0.5 * BOX, mass=MASS, group=1)
    cube.rgba, cube.friction[0] = (0.95, 0.60, 0.25, 1), FRICTION
    mujoco = engine()
    # Otherwise the soft friction of MuJoCo lets the box creep by millimetres.
    specified.option.cone, specified.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, IMPRATIO
    for side in reversed(SIDES):
        specified.add_sensor(
            type=mujoco.mjtSensor.mjSENS_TOUCH,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            objname=f"{side}_touch",
        )
    return specified


@dataclass
class Record:
    """Motion of a run, a row per tick, of the movement with its rests.

    Attributes
    ----------
    commanded, measured : (T, 14) array
        Absolute and relative pose of the pads.
    box : (T, 7) array
        Pose of the middle of the box.
    force : (T, 2) array
        Normal force of each pad on the box [N].
    others : (T,) array of bool
        Ticks in which the robot touches anything else, or itself.
    saturated : (T,) array of bool
        Ticks in which a motor was at its limit.
    states : list of array
        Positions of the simulation, for pictures.
    """

    commanded: list[np.ndarray] = field(default_factory=list)
    measured: list[np.ndarray] = field(default_factory=list)
    box: list[np.ndarray] = field(default_factory=list)
    force: list[np.ndarray] = field(default_factory=list)
    others: list[bool] = field(default_factory=list)
    saturated: list[bool] = field(default_factory=list)
    states: list[np.ndarray] = field(default_factory=list)

    def rows(self, name: str) -> np.ndarray:
        """Returns the rows of an attribute as an array."""
        return np.array(getattr(self, name))


class Carrier(TorqueControlled):
    """Baxter with a box on a table, whose pads follow an absolute and a relative pose."""

    position_gain, velocity_gain = STIFFNESS, DAMPING

    def __init__(self) -> None:
        kinematic = robot().compile()
        self.pads = {
            side: MujocoKinematics(kinematic, site=f"{side}_pad", joints=JOINTS) for side in SIDES
        }
        published = pdmp.robots.REGISTRY["baxter"]
        velocity = dict(zip(published.joints, published.velocity, strict=True))
        limits = {name: velocity[name.partition("_")[2]] for name in JOINTS}
        sites = [f"{side}_pad" for side in reversed(SIDES)]
        self.inverse = InverseKinematics(kinematic, sites, NEAR, limits)
        self.inverse.start(self.hands(START, pads_of(BOX[1] + OPEN)))
        super().__init__(scene(), JOINTS, self.inverse.position, {})
        self.record = Record()
        geoms = [self.model.geom(k).name for k in range(self.model.ngeom)]
        box, table, *pads = map(geoms.index, ("box", "table", *sites))
        self._allowed = [{box, other} for other in (table, *pads)]

    @staticmethod
    def hands(absolute: np.ndarray, relative: np.ndarray) -> np.ndarray:
        """Returns the poses (2, 7) of the left and the right pad."""
        return np.array(left_right(absolute, relative, reference=FACING))

    def measured(self) -> np.ndarray:
        """Returns the absolute and the relative pose (14,) of the pads."""
        left, right = (self.pads[side].forward(self.position) for side in reversed(SIDES))
        return np.concatenate(absolute_relative(left, right, reference=FACING))

    def follow(self, pose: np.ndarray) -> None:
        """Moves the pads towards an absolute and a relative pose (14,) for one tick."""
        inverse = self.inverse
        inverse.follow(self.hands(pose[:7], pose[7:]))
        self.move(inverse.position, inverse.velocity, inverse.acceleration)
        record, data = self.record, self.data
        record.commanded.append(pose.copy())
        record.measured.append(self.measured())
        body = data.body("box")
        record.box.append(np.concatenate([body.xpos, body.xquat]))
        # Forces of the last step; those of the present contacts are not computed yet.
        record.force.append(data.sensordata.copy())
        record.others.append(self._others())
        record.saturated.append(self.saturated)
        record.states.append(data.qpos.copy())

    def _others(self) -> bool:
        """Returns whether the robot touches anything but the box with its pads."""
        pairs = self.data.contact.geom[self.data.contact.dist < 0].tolist()
        return any(set(pair) not in self._allowed for pair in pairs)


def carry(model: pdmp.Model, conditions: pdmp.Conditions, *, closed: bool, held: bool) -> Record:
    """Grasps the box, carries it, and holds it at the end.

    Parameters
    ----------
    model : pdmp.Model
        Primitive of absolute and relative pose.
    conditions : pdmp.Conditions
        Its conditions.
    closed : bool
        True to return the measured absolute pose to the controller, with the commanded relative
        pose: compliant in the absolute pose, stiff in the relative one.
    held : bool
        True to hold a joint of the right arm for a while during the movement.
    """
    carrier, controller = Carrier(), model.controller(DT, conditions)
    grasp, apart = controller.position[7:].copy(), pads_of(BOX[1] + OPEN)
    for tick in range(round((GRASP + WAIT) / DT)):
        s = min(1.0, tick * DT / GRASP)
        share = s**3 * (10 - 15 * s + 6 * s**2)
        relative = apart + share * (grasp - apart)
        relative[3:] /= np.linalg.norm(relative[3:])
        carrier.follow(np.concatenate([START, relative]))
    carrier.record = Record()
    tick, rest = 0, round(WAIT / DT)
    while rest:
        time = tick * DT
        if time > MAX_TIME:
            raise RuntimeError(f"the movement does not end within {MAX_TIME:g} s")
        if held and tick in {round(each / DT) for each in HELD}:
            carrier.hold(HELD_JOINT if time < HELD[1] else None)
        measured = np.concatenate([carrier.measured()[:7], controller.position[7:]])
        if controller.step(measured=measured if closed else None) == pdmp.Status.FINISHED:
            rest -= 1
        carrier.follow(controller.position)
        tick += 1
    return carrier.record
