"""Probabilistic movement primitive, conditioned on points of a movement."""

import numpy as np

N_WEIGHTS = 20  # radial basis functions of a degree of freedom
RIDGE = 1e-4
DEVIATION = 0.01  # of the points, relative to the range

Array = np.ndarray


class ProMP:
    """A Gaussian over the weights of radial basis functions, by ridge regression.

    Paraschos, Daniel, Peters, Neumann, Autonomous Robots 42 (2018), doi:10.1007/s10514-017-9648-7.
    """

    def __init__(self, movements: Array) -> None:
        """Learns from movements (M, S, D) at even phases."""
        basis = radial_basis(np.linspace(0, 1, movements.shape[1]))
        ridge = basis.T @ basis + RIDGE * np.eye(N_WEIGHTS)
        weights = np.array([np.linalg.solve(ridge, basis.T @ movement) for movement in movements])
        self.mean = weights.mean(axis=0)
        self.deviations = (weights - self.mean) / np.sqrt(len(movements) - 1)
        self.noise = (DEVIATION * np.ptp(movements, axis=(0, 1))) ** 2

    def conditioned(self, phases: Array, points: Array, wanted: Array) -> Array:
        """Returns the positions (K, D) at the wanted phases, given points (N, D) at phases."""
        basis = radial_basis(phases)
        # The covariance of the points has rank M - 1: M equations are solved, not N·D.
        rows = np.einsum("nw,mwd->mnd", basis, self.deviations)
        scaled = (rows / self.noise).reshape(len(rows), -1)
        residual = (points - basis @ self.mean).ravel()
        gram = np.eye(len(rows)) + scaled @ rows.reshape(len(rows), -1).T
        change = np.tensordot(np.linalg.solve(gram, scaled @ residual), self.deviations, 1)
        return radial_basis(wanted) @ (self.mean + change)


def radial_basis(phases: Array) -> Array:
    """Returns normalised radial basis functions (N, N_WEIGHTS) at phases from 0 to 1."""
    distances = (phases[:, None] - np.linspace(0, 1, N_WEIGHTS)) * (N_WEIGHTS - 1)
    basis = np.exp(-0.5 * distances**2)
    return basis / basis.sum(axis=1, keepdims=True)
