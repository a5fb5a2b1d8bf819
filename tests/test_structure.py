"""The layers of the core in CONTRIBUTING.md match its sources."""

import re
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = ROOT / "crates" / "pdmp-core" / "src"


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


def upward_imports(sources: Path) -> set[tuple[str, str]]:
    """Returns the files that name a layer above their own, with that layer."""
    order = layers()
    return {
        (str(path.relative_to(sources)), other)
        for layer, path, code in code_of(sources)
        for other in re.findall(r"\bcrate::(\w+)", code)
        if other in order[order.index(layer) + 1 :]
    }


def stray_methods(sources: Path) -> set[tuple[str, str]]:
    """Returns the files that add methods to a type of another layer, with that type.

    A method call needs no import: were the method defined above its type, a layer below could
    call it unseen.
    """
    code = code_of(sources)
    home: dict[str, set[str]] = {}
    for layer, _, text in code:
        for name in re.findall(r"\b(?:struct|enum) (\w+)", text):
            home.setdefault(name, set()).add(layer)
    return {
        (str(path.relative_to(sources)), name)
        for layer, path, text in code
        for name in re.findall(r"^impl(?:<[^>]*>)? (\w+)(?:<[^>]*>)? \{", text, re.MULTILINE)
        if layer not in home.get(name, {layer})
    }


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


@pytest.mark.parametrize(
    ("where", "line", "check"),
    [
        ("motion/rollout.rs", "use crate::learning::fit;", upward_imports),
        ("dynamics/transport.rs", "fn peek() { crate::model::Model::load(path); }", upward_imports),
        ("motion/batch.rs", "impl Model {\n    fn batch(&self) {}\n}", stray_methods),
        ("learning/fit.rs", "impl Controller {\n    fn follow(&self) {}\n}", stray_methods),
    ],
)
def test_a_violation_is_found(tmp_path: Path, where: str, line: str, check) -> None:
    """A planted import or method of the wrong layer is reported with its file."""
    sources = shutil.copytree(SOURCES, tmp_path / "src")
    target = sources / where
    target.write_text(f"{line}\n{target.read_text(encoding='utf-8')}", encoding="utf-8")
    assert [file for file, _ in check(sources)] == [where]
