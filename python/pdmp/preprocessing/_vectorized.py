"""Vectorisation of functions of one demonstration."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar, overload

from pdmp._messages import printable
from pdmp._native import Demonstration
from pdmp.io._collections import ListedDemonstrations, NamedDemonstrations

P = ParamSpec("P")
R = TypeVar("R")
Name = TypeVar("Name")


class Vectorized(Protocol[P, R]):
    """Function of one demonstration, or of each of a sequence or mapping of them."""

    @overload
    def __call__(self, demo: Demonstration, *args: P.args, **kwargs: P.kwargs) -> R: ...
    @overload
    def __call__(
        self, demo: Mapping[Name, Demonstration], *args: P.args, **kwargs: P.kwargs
    ) -> dict[Name, R]: ...
    @overload
    def __call__(
        self, demo: Sequence[Demonstration], *args: P.args, **kwargs: P.kwargs
    ) -> list[R]: ...


def vectorized(function: Callable[Concatenate[Demonstration, P], R]) -> Vectorized[P, R]:
    """Returns a function that also takes a sequence or a mapping of demonstrations."""

    @wraps(function)
    def for_each(demo: Any, *args: Any, **kwargs: Any) -> Any:
        names = getattr(demo, "context_names", None)
        if isinstance(demo, Mapping):
            own = {name: _apply(name, one, args, kwargs) for name, one in demo.items()}
            return NamedDemonstrations(own, names) if names and _demos(own.values()) else own
        if isinstance(demo, Sequence) and not isinstance(demo, str):
            listed = [_apply(f"demo {m}", one, args, kwargs) for m, one in enumerate(demo)]
            return ListedDemonstrations(listed, names) if names and _demos(listed) else listed
        return function(demo, *args, **kwargs)

    def _apply(name: object, demo: Demonstration, args: Any, kwargs: Any) -> Any:
        try:
            return function(demo, *args, **kwargs)
        except (ValueError, TypeError) as error:
            kind = TypeError if isinstance(error, TypeError) else ValueError
            raise kind(printable(f"{name}: {error}")) from None

    return for_each


def _demos(values: Iterable[Any]) -> bool:
    return all(isinstance(value, Demonstration) for value in values)
