"""Model of arm swing in twelve styles of walking, with a cycle of both arms for each.

The recordings of the paper were never published. This model, based on published measurements of
human gait, replaces them:

- People of any size walk at two steps, and thus one swing of an arm, per second (MacDougall,
  Moore, Journal of Applied Physiology 99, 2005, 1164-1173), and make 0.83 to 1.95 strides per
  second between walking at 1 m/s and running at 8 (Nilsson, Thorstensson, Acta Physiologica
  Scandinavica 129, 1987, 107-114); running begins at some 1.2.
- The shoulder swings through about 30° at usual speed, more of it backwards, with the elbow some
  30° bent and bending as the arm comes forward (Murray, Sepic, Barnard, Physical Therapy 47, 1967,
  272-284); both arcs grow with speed.
- Runners hold the elbow bent near a right angle, walkers hardly bent (Yegian, Tucker, Gillinov,
  Lieberman, Journal of Experimental Biology 222, 2019, jeb197228).
- Arms take turns, half a stride apart. In very slow walking they swing with every step, twice a
  stride (Wagenaar, van Emmerik, Journal of Biomechanics 33, 2000, 853-861).

The parameters of the styles follow from these references and, for slower walks, from common
experience. They were chosen before any result was known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

import pdmp
from reproduction.section import SEED

Array = NDArray[np.float64]

N_SAMPLES = 120
NOISE = 0.4  # °, of harmonics 1 to 3 of each joint
HANGING = np.radians([10.0, -50.0, 0.0, 0.0])
"""Joint angles [rad] about which the arms swing.

Baxter's upper arms cannot hang: they point at most 60° down. The first joint turns about the
vertical and makes the swing, forward and backward, of the lowered arm.
"""
NAMES = [f"{side}_q{joint}" for side in ("r", "l") for joint in (1, 2, 3, 4)]


@dataclass(frozen=True)
class Style:
    """Style of arm swing: means and arcs [°]; forward, outward, inward and flexion are positive."""

    frequency: float
    """Strides per second."""
    shoulder: tuple[float, float]
    """Mean and arc of the shoulder flexion."""
    elbow: tuple[float, float]
    """Mean and arc of the elbow flexion."""
    outward: tuple[float, float] = (0.0, 4.0)
    """Mean and arc of the abduction of the upper arm."""
    inward: tuple[float, float] = (0.0, 6.0)
    """Mean and arc of the rotation about the upper arm."""
    lag: float = 20.0
    """Phase lag of the elbow behind the shoulder."""
    twice: float = 0.0
    """Arc of the shoulder's swing at twice the frequency."""


STYLES = {
    "normal": Style(1.00, (-8, 32), (30, 22)),
    "slow": Style(0.80, (-6, 20), (25, 12)),
    "strolling": Style(0.70, (-5, 8), (20, 6), twice=8),
    "brisk": Style(1.15, (-6, 42), (35, 34)),
    "striding": Style(0.95, (-4, 60), (28, 34)),
    "marching": Style(1.00, (4, 70), (10, 8), outward=(0, 2), lag=0),
    "jogging": Style(1.35, (-6, 46), (88, 26), inward=(8, 12)),
    "running": Style(1.45, (-6, 64), (92, 36), inward=(6, 12)),
    "race walking": Style(1.50, (-6, 66), (84, 20), inward=(16, 18), outward=(4, 6)),
    "girly": Style(1.05, (-12, 24), (55, 16), outward=(12, 8), inward=(-14, 16)),
    "proud": Style(0.95, (-14, 38), (22, 16), outward=(12, 6)),
    "tired": Style(0.75, (4, 14), (16, 6), outward=(-2, 2), lag=50),
}


def cycle(style: Style, noise: Generator) -> Array:
    """Returns joint angles of one stride (N_SAMPLES, 8) [rad], right arm before left arm."""
    phase = 2 * np.pi * np.arange(N_SAMPLES) / N_SAMPLES
    return np.hstack([_arm(style, phase, noise), _arm(style, phase + np.pi, noise)])


def demonstrate(seed: int = SEED) -> list[pdmp.Demonstration]:
    """Returns a cycle of each style."""
    noise = np.random.default_rng(seed)
    return [
        pdmp.Demonstration(
            cycle(style, noise),
            dt=1 / (style.frequency * N_SAMPLES),
            names=NAMES,
            units=["rad"] * len(NAMES),
        )
        for style in STYLES.values()
    ]


def _arm(style: Style, phase: Array, noise: Generator) -> Array:
    def swing(mean: float, arc: float, lag: float = 0.0) -> Array:
        return np.asarray(mean + 0.5 * arc * np.cos(phase - np.radians(lag)))

    shoulder = swing(*style.shoulder) + 0.5 * style.twice * np.cos(2 * phase)
    bent = swing(*style.elbow, style.lag)
    angles = np.column_stack([shoulder, swing(*style.outward), swing(*style.inward), -bent])
    for harmonic in (1, 2, 3):
        cosines, sines = noise.normal(0, NOISE, (2, 4))
        angles += np.outer(np.cos(harmonic * phase), cosines)
        angles += np.outer(np.sin(harmonic * phase), sines)
    return np.asarray(HANGING + np.radians(angles))
