"""Writes the docstrings of the compiled module into its stub, where editors look for them.

`stubs.py` checks that `python/pdmp/_native.pyi` has the docstrings of `pdmp._native`;
`stubs.py --write` writes them there. Signatures and types are written by hand.
"""

import ast
import inspect
import subprocess
import sys
from pathlib import Path
from types import ModuleType

from pdmp import _native

STUB = Path(__file__).resolve().parent.parent / "python" / "pdmp" / "_native.pyi"


def documented(text: str, module: ModuleType) -> str:
    """Returns the text of a stub with the docstrings of the module it describes."""
    lines = text.splitlines()
    # Backwards, so that line numbers stay valid.
    for node, doc in reversed(list(_docstrings(ast.parse(text), module))):
        if isinstance(node, ast.ClassDef) and node.body[0].lineno > node.lineno:
            _document_class(lines, node, doc)
        else:
            _document_body(lines, node, doc)
    ruff = (sys.executable, "-m", "ruff", "format", "--stdin-filename", STUB.name, "-")
    return subprocess.run(
        ruff, input="\n".join(lines) + "\n", capture_output=True, text=True, check=True
    ).stdout


def _docstrings(
    tree: ast.Module, module: ModuleType
) -> list[tuple[ast.ClassDef | ast.FunctionDef, str]]:
    """Returns classes, functions and methods of the stub in their order, with their docstrings."""
    found = []
    for node in tree.body:
        owner = getattr(module, getattr(node, "name", ""), None)
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and owner is not None:
            found.append((node, inspect.getdoc(owner) or ""))
        if isinstance(node, ast.ClassDef) and owner is not None:
            for item in node.body:
                if isinstance(item, ast.FunctionDef) and not _is_silent(item):
                    found.append((item, inspect.getdoc(getattr(owner, item.name)) or ""))
    return found


def _is_silent(function: ast.FunctionDef) -> bool:
    """Returns True for special methods and setters, which have no docstrings."""
    setter = any(isinstance(each, ast.Attribute) for each in function.decorator_list)
    return setter or function.name.startswith("__")


def _quoted(doc: str, indent: str) -> list[str]:
    """Returns the lines of a docstring."""
    prefix = "r" if "\\" in doc else ""
    first, *rest = doc.splitlines()
    body = [f'{indent}{prefix}"""{first}', *(f"{indent}{line}".rstrip() for line in rest)]
    if rest:
        return [*body, f'{indent}"""']
    return [f'{body[0]}"""']


def _document_body(lines: list[str], node: ast.ClassDef | ast.FunctionDef, doc: str) -> None:
    """Replaces the body of a function or an empty class by its docstring, or by an ellipsis."""
    body = node.body[0]
    header = lines[body.lineno - 1][: body.col_offset].rstrip()
    rest = lines[body.lineno - 1][body.end_col_offset or 0 :].strip()
    start = body.lineno - 1
    if not header:  # the body is on separate lines
        start -= 1
        header, _, rest = lines[start].partition("  # ")
        rest = f"# {rest}" if rest else ""
    comment = f"  {rest}" if rest.startswith("#") else ""
    indent = " " * (node.col_offset + 4)
    body_lines = [header + comment, *_quoted(doc, indent)] if doc else [f"{header} ...{comment}"]
    lines[start : node.end_lineno] = body_lines


def _document_class(lines: list[str], node: ast.ClassDef, doc: str) -> None:
    """Inserts or replaces the docstring of a class."""
    first = node.body[0]
    if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
        del lines[first.lineno - 1 : first.end_lineno]
    if doc:
        header = max(each.lineno for each in [node, *node.bases])
        lines[header:header] = _quoted(doc, " " * (node.col_offset + 4))


def main() -> int:
    """Writes the docstrings, or reports that they are stale."""
    present = STUB.read_text(encoding="utf-8")
    wanted = documented(present, _native)
    if "--write" in sys.argv[1:]:
        STUB.write_text(wanted, encoding="utf-8")
    elif present != wanted:
        print(f"{STUB.name}: docstrings differ from those of the module; run .ci/stubs.py --write")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
