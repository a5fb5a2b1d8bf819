"""Movements as differentiable functions of their conditions, for torch and jax.

`torch_rollouts` and `jax_rollouts` wrap `Model.rollouts` and its exact vector-Jacobian products,
`Model.rollouts_vjp`, for the automatic differentiation of these frameworks, so that a network may
be trained through a movement. Neither framework is imported until its function is called. Movements
are computed on the processor, in double precision; results have the type and the device of the
conditions.
"""

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmp._native import Conditions, Model

__all__ = ["jax_rollouts", "torch_rollouts"]

_NUMBERS = ("amplitude", "tau")


def torch_rollouts(
    model: Model,
    conditions: Conditions | None = None,
    *,
    dt: float = 0.01,
    duration: float | None = None,
    derivatives: int = 0,
    threads: int | None = None,
) -> Callable[..., tuple[Any, ...]]:
    """Returns the rollouts of a model as a differentiable function of tensors.

    Parameters
    ----------
    model : Model
        Model, also with rotations.
    conditions : Conditions, optional
        Conditions of all movements that the function is not given.
    dt : float
        Interval between samples in s.
    duration : float, optional
        Length of all movements in s, by default the demonstrated one. It does not depend on `tau`.
    derivatives : int
        Order of the highest derivative that the function returns, as in `Model.rollouts`.
    threads : int, optional
        Largest number of threads, as in `Model.rollouts`.

    Returns
    -------
    callable
        Function of conditions by name, each a tensor (n,) or (B, n); `tau` and `amplitude` are
        scalars or (B,). It returns a tuple of tensors (B, T, D): positions, and the derivatives
        asked for, of the shapes of `Model.rollouts`.
        The gradient with respect to a unit quaternion q is that of the function of q/|q|,
        orthogonal to q. Gradients with respect to `tau` hold at fixed times, for accelerations as
        in `Model.jacobian`, but not for those of rotations. Second derivatives are not available.

    Raises
    ------
    ModuleNotFoundError
        torch is not installed.

    Examples
    --------
    A loss of the movements of a network::

        move = pdmp.autodiff.torch_rollouts(model, dt=0.01)
        style, goal = network(images).split([model.n_styles, model.n_dofs], dim=1)
        (positions,) = move(style=style, goal=goal)
        ((positions[:, 50] - targets) ** 2).mean().backward()
    """
    torch: Any = import_module("torch")
    work = _Rollouts(model, conditions, dt, duration, derivatives, threads)

    class Rollouts(torch.autograd.Function):  # type: ignore[misc]
        """Rollouts of one model."""

        @staticmethod
        def forward(ctx: Any, names: tuple[str, ...], *values: Any) -> tuple[Any, ...]:
            ctx.names = names
            ctx.save_for_backward(*values)
            movements = work.forward(dict(zip(names, map(_from_torch, values), strict=True)))
            # The type and the device of a sum of the conditions.
            like = sum(value.new_zeros(()) for value in values)
            return tuple(torch.from_numpy(array).to(like) for array in movements)

        @staticmethod
        @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
        def backward(ctx: Any, *cotangents: Any) -> tuple[Any, ...]:
            values = ctx.saved_tensors
            given = dict(zip(ctx.names, map(_from_torch, values), strict=True))
            wrt = [
                name
                for name, needed in zip(ctx.names, ctx.needs_input_grad[1:], strict=True)
                if needed
            ]
            found = work.backward(given, wrt, [_from_torch(array) for array in cotangents])
            gradients = {name: torch.from_numpy(np.asarray(array)) for name, array in found.items()}
            return None, *(
                gradients[name].to(value) if name in gradients else None
                for name, value in zip(ctx.names, values, strict=True)
            )

    def rollouts(**conditions: Any) -> tuple[Any, ...]:
        values = {name: torch.as_tensor(value) for name, value in conditions.items()}
        movements: tuple[Any, ...] = Rollouts.apply(tuple(values), *values.values())
        return movements

    return rollouts


def jax_rollouts(
    model: Model,
    conditions: Conditions | None = None,
    *,
    dt: float = 0.01,
    duration: float | None = None,
    derivatives: int = 0,
    threads: int | None = None,
) -> Callable[..., tuple[Any, ...]]:
    """Returns the rollouts of a model as a function of arrays that jax differentiates in reverse.

    The function may be transformed by `jax.grad`, `jax.vjp`, `jax.jit` and `jax.vmap`. It calls
    back to the processor, once a batch; under `jax.vmap` once a mapped element, so that a batch
    (B, n) is faster.

    Parameters
    ----------
    model, conditions, dt, duration, derivatives, threads
        As for `torch_rollouts`.

    Returns
    -------
    callable
        Function of conditions by name, each an array (n,) or (B, n); `tau` and `amplitude` are
        scalars or (B,). It returns a tuple of arrays (B, T, D): positions, and the derivatives
        asked for, of the shapes of `Model.rollouts`.
        The gradient with respect to a unit quaternion q is that of the function of q/|q|,
        orthogonal to q. Gradients with respect to `tau` hold at fixed times, for accelerations as
        in `Model.jacobian`, but not for those of rotations. Second and forward derivatives are not
        available.

    Raises
    ------
    ModuleNotFoundError
        jax is not installed.

    Examples
    --------
    The gradient of a loss::

        move = pdmp.autodiff.jax_rollouts(model, dt=0.01)


        def loss(weights, images, targets):
            style, goal = network(weights, images)
            (positions,) = move(style=style, goal=goal)
            return ((positions[:, 50] - targets) ** 2).mean()


        gradient = jax.jit(jax.grad(loss))
    """
    jax: Any = import_module("jax")
    work = _Rollouts(model, conditions, dt, duration, derivatives, threads)

    def forward(values: dict[str, Any]) -> tuple[Any, ...]:
        dtype = jax.numpy.result_type(float, *values.values())
        columns = (model.n_coordinates, model.n_dofs, model.n_dofs)[: derivatives + 1]
        shapes = tuple(
            jax.ShapeDtypeStruct((work.rows(values), work.n_samples, n), dtype) for n in columns
        )

        def call(given: dict[str, Any]) -> tuple[Any, ...]:
            return tuple(array.astype(dtype) for array in work.forward(_as_numpy(given)))

        made: tuple[Any, ...] = jax.pure_callback(call, shapes, values, vmap_method="sequential")
        return made

    def backward(values: dict[str, Any], cotangents: tuple[Any, ...]) -> tuple[dict[str, Any]]:
        shapes = {n: jax.ShapeDtypeStruct(v.shape, v.dtype) for n, v in values.items()}

        def call(given: dict[str, Any], cotangents: tuple[Any, ...]) -> dict[str, Any]:
            arrays = [np.asarray(array, dtype=float) for array in cotangents]
            found = work.backward(_as_numpy(given), list(given), arrays)
            return {name: array.astype(shapes[name].dtype) for name, array in found.items()}

        return (jax.pure_callback(call, shapes, values, cotangents, vmap_method="sequential"),)

    differentiable = jax.custom_vjp(forward)
    differentiable.defvjp(lambda values: (forward(values), values), backward)

    def rollouts(**conditions: Any) -> tuple[Any, ...]:
        made: tuple[Any, ...] = differentiable(
            {name: jax.numpy.asarray(value) for name, value in conditions.items()}
        )
        return made

    return rollouts


class _Rollouts:
    """Rollouts of a model at fixed times and their vector-Jacobian products, in numpy."""

    def __init__(
        self,
        model: Model,
        conditions: Conditions | None,
        dt: float,
        duration: float | None,
        derivatives: int,
        threads: int | None,
    ) -> None:
        self.model, self.conditions, self.derivatives = model, conditions, derivatives
        duration = model.duration if duration is None else duration
        self.options: dict[str, Any] = {"dt": dt, "duration": duration, "threads": threads}
        (positions,) = model.rollouts(conditions, dt=dt, duration=duration, derivatives=0)
        self.n_samples = positions.shape[1]

    @staticmethod
    def rows(values: dict[str, Any]) -> int:
        """Returns the number of movements."""
        return max((v.shape[0] for n, v in values.items() if v.ndim == _axes(n) + 1), default=1)

    def forward(self, given: dict[str, Any]) -> tuple[NDArray[np.float64], ...]:
        """Computes movements (B, T, D)."""
        return self.model.rollouts(
            self.conditions, derivatives=self.derivatives, **self.options, **given
        )

    def backward(
        self,
        given: dict[str, Any],
        wrt: Any,
        cotangents: Sequence[NDArray[np.float64]],
    ) -> dict[str, NDArray[np.float64]]:
        """Computes gradients of the shapes of the conditions."""
        found = self.model.rollouts_vjp(
            wrt, tuple(cotangents), self.conditions, **self.options, **given
        )
        return {
            name: gradient if given[name].ndim == _axes(name) + 1 else gradient.sum(axis=0)
            for name, gradient in zip(wrt, found, strict=True)
        }


def _axes(name: str) -> int:
    """Returns the number of axes of a condition that all movements share."""
    return 0 if name in _NUMBERS else 1


def _as_numpy(values: dict[str, Any]) -> dict[str, NDArray[np.float64]]:
    return {name: np.asarray(value, dtype=float) for name, value in values.items()}


def _from_torch(tensor: Any) -> NDArray[np.float64]:
    array: NDArray[np.float64] = tensor.detach().cpu().double().numpy()
    return array
