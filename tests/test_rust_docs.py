"""Public functions of the core that can fail appear in examples, which `cargo test --doc` runs."""

import re
from pathlib import Path

SOURCES = Path(__file__).parents[1] / "crates" / "pdmp-core" / "src"
FUNCTION = re.compile(r"^( *)pub (?:const )?fn (\w+)([^{;]*)\{", re.MULTILINE)
IMPLEMENTATION = re.compile(r"^impl(?:<.*>)? (\w+)(?:<.*>)? \{", re.MULTILINE)


def sources() -> dict[str, str]:
    """Returns the source files by name, without their unit tests."""
    return {
        str(path.relative_to(SOURCES)): path.read_text(encoding="utf-8").partition(
            "#[cfg(test)]\nmod tests {"
        )[0]
        for path in sorted(SOURCES.rglob("*.rs"))
        if path.name != "tests.rs"
    }


def examples(text: str) -> str:
    """Returns the code in the documentation of a file."""
    lines = re.findall(r"^ *//[/!] ?(.*)$", text, re.MULTILINE)
    blocks = re.findall(r"^```(\w*)\n(.*?)^```", "\n".join(lines), re.DOTALL | re.MULTILINE)
    return "\n".join(code for language, code in blocks if not language)


def fallible(text: str) -> list[tuple[str, str]]:
    """Returns name and call, as a pattern, of each public function that returns a Result."""
    found = []
    owners = [(match.start(), match[1]) for match in IMPLEMENTATION.finditer(text)]
    for match in FUNCTION.finditer(text):
        indent, name, rest = match.groups()
        owner = [owner for start, owner in owners if start < match.start()][-1:] if indent else []
        method = re.match(r"(<.*?>)?\(\s*&?(mut )?self\b", rest)
        scope = r"\." if method else "".join(rf"\b{each}::" for each in owner) or r"\b"
        if "-> Result<" in rest:
            found.append((name, rf"{scope}{name}(::<.*>)?\("))
    return found


def without_example(files: dict[str, str]) -> set[str]:
    """Returns the fallible public functions that no example calls."""
    called = "\n".join(map(examples, files.values()))
    return {
        f"{file}: {name}"
        for file, text in files.items()
        for name, call in fallible(text)
        if not re.search(call, called)
    }


def test_fallible_public_functions_have_an_example() -> None:
    """Every public function that returns a Result is called in an example."""
    files = sources()
    assert sum(len(fallible(text)) for text in files.values()) > 50
    assert not without_example(files)


def test_a_missing_example_is_found() -> None:
    """A function is reported unless an example calls it, as a method or by its type."""
    method = "impl Bird {\n    pub fn fly(&self) -> Result<()> {\n    }\n}\n"
    constructor = method.replace("&self", "")
    for text in (method, constructor, f"/// bird.fly() is fast.\n{method}"):
        assert without_example({"a.rs": text}) == {"a.rs: fly"}
    assert without_example({"a.rs": f"/// ```\n/// bird.fly()?;\n/// ```\n{constructor}"})
    assert not without_example({"a.rs": f"/// ```\n/// bird.fly()?;\n/// ```\n{method}"})
    assert not without_example({"a.rs": f"/// ```\n/// Bird::fly()?;\n/// ```\n{constructor}"})
