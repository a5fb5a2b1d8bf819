"""The layers of the core in CONTRIBUTING.md match its sources."""

import re
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = ROOT / "crates" / "pdmp-core" / "src"
MAX_LINES = 400
FOREIGN_METHODS = frozenset(
    {
        *(
            "abs",
            "chunks",
            "clone",
            "column",
            "extend",
            "fill",
            "filter",
            "find",
            "first",
            "for_each",
        ),
        *(
            "inverse",
            "iter",
            "last",
            "len",
            "load",
            "map",
            "next",
            "reduce",
            "replace",
            "row",
            "rows",
            "shape",
            "sum",
        ),
        *("sqrt", "try_for_each", "update", "write"),
    }
)
"""Methods of this library, the standard library and ndarray alike."""


def layers() -> list[str]:
    """Returns the layers of the core, lowest first, as CONTRIBUTING.md lists them."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    return re.findall(r"^\| \d+ \| `(\w+)/?` \|", text, re.MULTILINE)


def code_of(sources: Path) -> list[tuple[str, Path, str]]:
    """Returns layer, path and code of each file, without comments, unit tests and literals."""
    found = []
    for path in sorted(sources.rglob("*.rs")):
        layer = path.relative_to(sources).parts[0].removesuffix(".rs")
        if layer != "lib" and path.name != "tests.rs":
            code = re.sub(r"//.*", "", path.read_text(encoding="utf-8"))
            found.append((layer, path, code.partition("mod tests {")[0]))
    return found


def expanded(tree: str) -> list[str]:
    """Returns the paths of a `use` declaration, its groups resolved."""
    head, brace, rest = tree.partition("{")
    if not brace:
        return [tree.partition(" as ")[0].strip()]
    branches, depth = [""], 0
    for letter in rest.rpartition("}")[0]:
        depth += {"{": 1, "}": -1}.get(letter, 0)
        if letter == "," and depth == 0:
            branches.append("")
        else:
            branches[-1] += letter
    return [head.strip() + path for each in branches if each.strip() for path in expanded(each)]


def crate_paths(code: str, module: tuple[str, ...]) -> set[tuple[str, ...]]:
    """Returns the paths that a module names, from the root of the crate."""
    declared = re.findall(r"\buse\s+([^;]+);", code)
    inline = re.findall(r"\b(?:crate|super|self)(?:\s*::\s*\w+)+", code)
    found = set()
    for path in [*(path for tree in declared for path in expanded(tree)), *inline]:
        first, *names = re.split(r"\s*::\s*", path)
        start = {"crate": (), "self": module, "super": module[:-1]}.get(first)
        if start is None:  # of another crate
            continue
        while names[:1] == ["super"]:
            start, names = start[:-1], names[1:]
        found.add((*start, *names))
    return found


def reexports(sources: Path) -> dict[str, str]:
    """Returns the names at the root of the crate, with their layers."""
    found = {}
    for tree in re.findall(r"\bpub use ([^;]+);", (sources / "lib.rs").read_text(encoding="utf-8")):
        for path in expanded(tree):
            layer, *_, name = path.split("::")
            found[name] = layer
    return found


def upward_imports(sources: Path) -> set[tuple[str, str]]:
    """Returns the files that name a layer above their own, with that layer."""
    order, root = layers(), reexports(sources)
    found = set()
    for layer, path, code in code_of(sources):
        module = path.relative_to(sources).with_suffix("").parts
        module = module[:-1] if module[-1] == "mod" else module
        for first, *_ in filter(None, crate_paths(code, module)):
            others = set(root.values()) if first == "*" else {root.get(first, first)}
            found |= {
                (str(path.relative_to(sources)), other)
                for other in others.intersection(order[order.index(layer) + 1 :])
            }
    return found


def concrete(text: str) -> str:
    """Returns a text without generic arguments, nested ones included."""
    text = text.replace("->", "")
    while (shorter := re.sub(r"(?:::)?<[^<>]*>", "", text)) != text:
        text = shorter
    return text


def stray_methods(sources: Path) -> set[tuple[str, str]]:
    """Returns the files that add methods to a type of another layer, with that type.

    A method call needs no import: were the method defined above its type, a layer below could
    call it unseen.
    """
    code = code_of(sources)
    home: dict[str, set[str]] = {}
    for layer, _, text in code:
        for name in re.findall(r"\b(?:struct|enum|union|trait) (\w+)", text):
            home.setdefault(name, set()).add(layer)
    return {
        (str(path.relative_to(sources)), name)
        for layer, path, text in code
        for head in re.findall(r"^\s*(?:unsafe )?impl\b([^{;]+)\{", text, re.MULTILINE)
        for name in re.findall(r"(\w+)\s*$", re.split(r"\bwhere\b", concrete(head))[0])
        if layer not in home.get(name, {layer})
    }


def methods(code: str) -> list[str]:
    """Returns the names of the methods that a module defines."""
    return re.findall(r"\bfn (\w+)(?:<[^(]*>)?\(\s*(?:&(?:'\w+ )?)?(?:mut )?self\b", code)


def method_calls(code: str) -> list[str]:
    """Returns the names of the methods that a module calls."""
    return re.findall(r"(?<!\.)\.(\w+)(?:::<[^(]*>)?\(", code)


def upward_calls(sources: Path) -> set[tuple[str, str]]:
    """Returns the files that call a method which only layers above their own define.

    A text has no types: a method that a lower layer, the standard library or another crate defines
    under the same name is taken for that one.
    """
    order, code = layers(), code_of(sources)
    home: dict[str, int] = {}
    for layer, _, text in code:
        for name in methods(text):
            home[name] = min(home.get(name, len(order)), order.index(layer))
    return {
        (str(path.relative_to(sources)), name)
        for layer, path, text in code
        for name in method_calls(text)
        if home.get(name, 0) > order.index(layer) and name not in FOREIGN_METHODS
    }


def hidden_calls(sources: Path) -> set[tuple[str, str]]:
    """Returns the files of `learning` that call a method of `motion` and do not name that layer."""
    code, root = code_of(sources), reexports(sources)
    home: dict[str, set[str]] = {}
    for layer, _, text in code:
        for name in methods(text):
            home.setdefault(name, set()).add(layer)
    found = set()
    for layer, path, text in code:
        named = {root.get(first, first) for first, *_ in filter(None, crate_paths(text, ()))}
        if layer == "learning" and "motion" not in named:
            found |= {
                (str(path.relative_to(sources)), name)
                for name in set(method_calls(text)) - FOREIGN_METHODS
                if home.get(name) == {"motion"}
            }
    return found


def test_every_module_belongs_to_one_layer() -> None:
    """The list of layers matches the modules."""
    modules = {path.stem for path in SOURCES.iterdir()} - {"lib"}
    assert sorted(layers()) == sorted(modules)


def test_layers_use_only_lower_layers() -> None:
    """No module imports from a layer above its own."""
    assert not upward_imports(SOURCES)


def test_methods_are_defined_in_the_layer_of_their_type() -> None:
    """No method is defined in a layer above its type."""
    assert not stray_methods(SOURCES)


def test_method_calls_follow_the_layers() -> None:
    """No module calls a method that only a layer above its own defines."""
    assert not upward_calls(SOURCES)


def test_learning_names_the_control_loop_where_it_calls_it() -> None:
    """A module of `learning` that calls a method of `motion` imports from it."""
    assert not hidden_calls(SOURCES)


def test_files_are_short() -> None:
    """A source file has at most 400 lines, its unit tests aside."""
    rust = [path for path in ROOT.glob("crates/*/src/**/*.rs") if path.name != "tests.rs"]
    python = [*ROOT.glob("python/pdmp/**/*.py"), *ROOT.glob("reproduction/**/*.py")]
    assert len(rust) > 100
    assert len(python) > 50
    lengths = {
        str(path.relative_to(ROOT)): text.partition("#[cfg(test)]\nmod tests {")[0].count("\n")
        for path in [*rust, *python]
        for text in [path.read_text(encoding="utf-8")]
    }
    assert not {name: lines for name, lines in lengths.items() if lines > MAX_LINES}


@pytest.mark.parametrize(
    ("where", "line", "check"),
    [
        ("motion/rollout.rs", "use crate::learning::fit;", upward_imports),
        (
            "motion/rollout.rs",
            "use crate::{error::Error, learning::{fit, FitOptions}};",
            upward_imports,
        ),
        ("motion/rollout.rs", "use super::super::learning::fit;", upward_imports),
        ("motion/controller/mod.rs", "use super::super::learning as other;", upward_imports),
        ("dynamics/mod.rs", "use super::{kind::Kind, motion};", upward_imports),
        ("dynamics/transport.rs", "use crate::Controller;", upward_imports),
        ("dynamics/transport.rs", "use crate::{Kind, rollout as roll};", upward_imports),
        ("motion/batch.rs", "fn peek() { crate::fit(demos); }", upward_imports),
        ("motion/batch.rs", "use crate::*;", upward_imports),
        ("dynamics/transport.rs", "fn peek() { crate::model::Model::load(path); }", upward_imports),
        ("motion/batch.rs", "impl Model {\n    fn batch(&self) {}\n}", stray_methods),
        ("learning/fit.rs", "impl Controller {\n    fn follow(&self) {}\n}", stray_methods),
        ("motion/batch.rs", "impl crate::model::Model {\n    fn batch(&self) {}\n}", stray_methods),
        ("motion/batch.rs", "impl Extra for Model {\n    fn batch(&self) {}\n}", stray_methods),
        (
            "motion/batch.rs",
            "impl<T: Into<Option<f64>>> Extra<Vec<T>> for crate::model::Model<Vec<T>> {}",
            stray_methods,
        ),
        ("motion/batch.rs", "impl<T> Extra for Model\nwhere\n    T: Copy,\n{\n}", stray_methods),
        ("model/mod.rs", "fn peek(c: &mut impl Any) { c.set_goal(&[0.0]); }", upward_calls),
        ("learning/fit.rs", "fn peek(c: &mut impl Any) { c.set_goal(&[0.0]); }", hidden_calls),
    ],
)
def test_a_violation_is_found(tmp_path: Path, where: str, line: str, check) -> None:
    """A planted import, method or call of the wrong layer is reported with its file."""
    sources = shutil.copytree(SOURCES, tmp_path / "src")
    target = sources / where
    target.write_text(f"{line}\n{target.read_text(encoding='utf-8')}", encoding="utf-8")
    assert {file for file, _ in check(sources)} == {where}
