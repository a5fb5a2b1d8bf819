"""Fits on a cluster, by Dask; needs the extra `dask`.

Every task is a function of one block of demonstrations, or of the results of two such tasks. Dask
computes a task of a lost worker again, from its block alone, and no block counts twice: partial
fits are merged to new ones.
"""

from __future__ import annotations

import copy
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from pdmp._native import (
    GP,
    BlockStyles,
    Demonstration,
    Model,
    NGnet,
    PartialFit,
    StyleProjection,
)
from pdmp.io._packages import load

if TYPE_CHECKING:
    import distributed
    from numpy.typing import ArrayLike

_Demos: TypeAlias = "Sequence[Demonstration | ArrayLike] | Mapping[str, Demonstration] | ArrayLike"
Block: TypeAlias = "_Demos | Callable[[], _Demos] | distributed.Future"
"""Block of demonstrations, a function that returns it, a Dask delayed object or a future."""


def fit_distributed(
    blocks: Iterable[Block],
    *,
    client: distributed.Client | None = None,
    kind: Literal["discrete", "rhythmic"] = "discrete",
    dt: float | None = None,
    period: float | None = None,
    map: Literal["auto", "stacked", "gp", "linear", "polynomial"] = "auto",
    n_styles: int | None = None,
    singular_value_share: float | None = None,
    basis: Literal["gp", "ngnet"] | GP | NGnet = "gp",
    smoothing: Literal["auto"] | float | None = "auto",
    nominal: int | None = None,
    n_samples: int | None = None,
    transport: Literal["learnt", "immediate"] | None = None,
    dof_scale: Literal["unit", "range"] | ArrayLike | None = None,
    tau: float | None = None,
    alpha_z: float = 25.0,
    beta_z: float | None = None,
    alpha_x: float | None = None,
    mu: float | None = None,
    progress: Callable[[str, float], object] | None = None,
) -> Model:
    """Fits a movement primitive to blocks of demonstrations on a cluster of Dask.

    The first pass adds each block to a `PartialFit`, and merges these pairwise to one; the second
    computes the styles of each block. The model is that of `PartialFit.finish` for the same blocks,
    but for rounding. Number of samples, cut-offs of smoothing and, with `tau`, the nominal duration
    are chosen from the first block.

    Parameters
    ----------
    blocks : iterable of blocks, or dask.bag.Bag
        Lists of demonstrations or arrays (B, T, D), in the order of the demonstrations. Functions
        without arguments that return one, as from `io.read_blocks`, Dask delayed objects and
        futures are computed by the workers, so that no block passes through this process. Each
        partition of a bag is a block.
        Blocks that were scattered cannot be computed again when their worker is lost.
    client : distributed.Client, optional
        Client of the cluster; by default the current one.
    kind, dt, period, map, n_styles, singular_value_share, basis, smoothing, nominal
        As for `fit`; `n_styles` is a number.
    n_samples, transport, dof_scale, tau, alpha_z, beta_z, alpha_x, mu
        As for `fit`.
    progress : callable, optional
        Called as `progress(stage, fraction)` with "targets" or "styles" and the completed fraction
        of the blocks. An exception that it raises cancels the fit on the cluster.

    Returns
    -------
    Model

    Raises
    ------
    ValueError
        The demonstrations or options are invalid, have rotations, or there is no block. As in an
        exception that the function of a block raises, a note names the block by its index.
    ImportError
        Dask is not installed.

    References
    ----------
    Demmel, Grigori, Hoemmen, Langou, SIAM J. Sci. Comput. 34 (2012) A206-A239,
    https://doi.org/10.1137/080731992
    """
    tasks = _Tasks(client if client is not None else _current_client(), progress)
    first_pass: dict[str, Any] = {
        "kind": kind,
        "dt": dt,
        "period": period,
        "smoothing": smoothing,
        "tau": tau,
    }
    first_pass |= {"n_samples": n_samples, "dof_scale": dof_scale, "alpha_z": alpha_z}
    first_pass |= {"beta_z": beta_z, "alpha_x": alpha_x, "mu": mu}
    try:
        parts = list(_partitions(blocks))
        if not parts:
            raise ValueError("blocks is empty: pass at least one block")
        whole, sizes = tasks.first_pass(parts, first_pass)
        factorised = whole.factorise(
            map=map,
            n_styles=n_styles,
            singular_value_share=singular_value_share,
            basis=basis,
            nominal=nominal,
            transport=transport,
            dof_scale=dof_scale,
        )
        return factorised.finish(tasks.styles(factorised.projection, parts, sizes))
    finally:
        tasks.cancel()


def _current_client() -> distributed.Client:
    client: distributed.Client = load("distributed", "dask", "fits on a cluster").get_client()
    return client


def _partitions(blocks: Any) -> Iterable[Any]:
    """Returns the partitions of a bag as delayed lists, and other blocks as they are."""
    partitions: Iterable[Any] = blocks.to_delayed() if hasattr(blocks, "to_delayed") else blocks
    return partitions


class _Tasks:
    """Tasks of one fit, which are cancelled together.

    No future is held longer than its result is needed, so that the cluster has few blocks and
    partial fits in memory at a time.
    """

    def __init__(
        self, client: distributed.Client, progress: Callable[[str, float], object] | None
    ) -> None:
        self.client = client
        self.progress = progress
        self.submitted: list[weakref.ref[Any]] = []

    def first_pass(
        self, blocks: Sequence[Any], options: dict[str, Any]
    ) -> tuple[PartialFit, list[int]]:
        """Returns the partial fit of all blocks, and the number of demonstrations of each."""
        empty = self.submit(_empty, self.block(blocks[0]), options)
        partials = [
            self.submit(_partial, empty, self.block(block), k, priority=-k)
            for k, block in enumerate(blocks)
        ]
        sizes = [self.submit(_size, partial, priority=1) for partial in partials]
        # Neighbours are merged, to keep the order.
        while len(partials) > 1:
            pairs = [partials[k : k + 2] for k in range(0, len(partials), 2)]
            partials = [
                self.submit(_merged, *pair, priority=1) if pair[1:] else pair[0] for pair in pairs
            ]
        counts = self.results(sizes, "targets")
        return partials[0].result(), counts

    def styles(
        self, projection: StyleProjection, blocks: Sequence[Any], sizes: list[int]
    ) -> list[BlockStyles]:
        """Returns the styles of all blocks."""
        shared = self.client.submit(StyleProjection.from_bytes, projection.to_bytes(), pure=False)
        firsts = [sum(sizes[:k]) for k in range(len(sizes))]
        futures = [
            self.submit(_styles, shared, self.block(block), k, first, priority=-k)
            for k, (block, first) in enumerate(zip(blocks, firsts, strict=True))
        ]
        return self.results(futures, "styles")

    def submit(self, function: Callable[..., Any], *arguments: Any, priority: int = 0) -> Any:
        """Submits a task. Equal tasks of different fits are different, as one may be cancelled.

        Blocks are read in their order and merged at once: of the partial fits, each of at most
        16·N² bytes, the cluster then has some for each worker and one for each level of the tree.
        """
        future = self.client.submit(function, *arguments, pure=False, priority=priority)
        self.submitted.append(weakref.ref(future))
        return future

    def block(self, block: Any) -> Any:
        """Returns a future for a delayed object, and other blocks as they are."""
        return self.client.compute(block) if hasattr(block, "dask") else block

    def results(self, futures: list[Any], stage: str) -> list[Any]:
        """Returns the results of tasks, and reports how many are completed."""
        from distributed import as_completed

        for done, _ in enumerate(as_completed(futures), 1):
            if self.progress is not None:
                self.progress(stage, done / len(futures))
        results: list[Any] = self.client.gather(futures)
        return results

    def cancel(self) -> None:
        """Cancels the tasks that are not finished."""
        futures = [future for reference in self.submitted if (future := reference()) is not None]
        self.client.cancel([future for future in futures if not future.done()])


def _read(block: Any) -> Any:
    return block() if callable(block) else block


@contextmanager
def _noted(index: int) -> Iterator[None]:
    """Notes the index of a block in an exception."""
    try:
        yield
    except Exception as error:
        error.add_note(f"Raised for blocks[{index}].")
        raise


def _empty(first: Any, options: dict[str, Any]) -> PartialFit:
    with _noted(0):
        return PartialFit(_read(first), threads=1, **options).empty()


def _partial(empty: PartialFit, block: Any, index: int) -> PartialFit:
    # The argument belongs to the worker, which passes it to other tasks too.
    partial = empty.empty()
    with _noted(index):
        partial.update(_read(block))
    return partial


def _size(partial: PartialFit) -> int:
    return partial.n_demos


def _merged(left: PartialFit, right: PartialFit) -> PartialFit:
    merged = copy.copy(left)
    merged.merge(right)
    return merged


def _styles(projection: StyleProjection, block: Any, index: int, first: int) -> BlockStyles:
    with _noted(index):
        return projection.styles(_read(block), first)
