"""Tables in Markdown."""

from collections.abc import Iterable, Sequence


def markdown_table(
    header: Sequence[object], rows: Iterable[Sequence[object]], n_names: int = 1
) -> str:
    """Returns a table: names in the first columns, numbers, aligned right, in the others."""
    align = ["---"] * n_names + ["--:"] * (len(header) - n_names)
    lines = [header, align, *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)
