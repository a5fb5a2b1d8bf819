"""Collections of demonstrations whose contexts have names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from pdmp._native import Demonstration

Contexts = dict[str, list[float | str]]


class NamedDemonstrations(dict[str, Demonstration]):
    """Demonstrations by name, as the readers return them.

    Attributes
    ----------
    context_names : tuple of Q str
        Names of the context values; empty if there are none.
    contexts : dict or None
        Context values of all demonstrations by their names, as `pdmp.fit` takes them.
    """

    def __init__(
        self,
        demos: Mapping[str, Demonstration] | Iterable[tuple[str, Demonstration]] = (),
        context_names: Sequence[str] = (),
    ) -> None:
        super().__init__(demos)
        self.context_names = tuple(context_names)

    @property
    def contexts(self) -> Contexts | None:
        """Context values by their names; None unless each demonstration has one for each name."""
        return _contexts(self.context_names, self.values())


class ListedDemonstrations(list[Demonstration]):
    """Demonstrations in the order of their files, with the names of their contexts.

    Attributes
    ----------
    context_names : tuple of Q str
        Names of the context values; empty if there are none.
    contexts : dict or None
        Context values of all demonstrations by their names, as `pdmp.fit` takes them.
    """

    def __init__(
        self, demos: Iterable[Demonstration] = (), context_names: Sequence[str] = ()
    ) -> None:
        super().__init__(demos)
        self.context_names = tuple(context_names)

    @property
    def contexts(self) -> Contexts | None:
        """Context values by their names; None unless each demonstration has one for each name."""
        return _contexts(self.context_names, self)


def _contexts(names: Sequence[str], demos: Iterable[Demonstration]) -> Contexts | None:
    rows = [[] if demo.context is None else list(demo.context) for demo in demos]
    if not names or any(len(row) != len(names) for row in rows):
        return None
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}
