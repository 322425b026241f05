"""The project speaks the words of its field: its private words are gone and stay gone."""

from __future__ import annotations

import ast
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

EVERYWHERE = {
    "hands": "reservation",
    "witness": "observation",
    "circumstances": "metadata",
    "shot about": "metadata",
    "zero line": "baseline",
    "foretold": "predicted",
    "foretell": "predict",
    "lessen": "reduce",
    "manieth": "nth",
    "riddle": "question",
    "vouch": "confirm",
}
"""Private word to the field's word: in no Markdown page, and no part of a name in the packages."""
IN_PROSE = {
    "mend": "repair, or correct",
    "the loop": "the diagnosis",
    "beside the middle": "off-centre",
    "slant": "oblique hit",
    "ladder": "models",
    "rung": "model",
    "foretells": "predicts",
    "lives in": "is in",
    "goes with": "correlates with",
    "tells apart": "distinguishes",
    "held against": "compared with",
}
"""The same for Markdown alone: in code some are keys of stored documents, which stay."""


def _files(pattern: str) -> list[Path]:
    """Return the project's files that git knows."""
    listed = subprocess.run(
        ["git", "ls-files", "--", pattern], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listed.returncode:
        pytest.skip("this is no checkout")
    return [path for name in listed.stdout.split() if (path := ROOT / name).is_file()]


def _prose(text: str) -> str:
    """Return Markdown without code, addresses of links and line breaks."""
    text = re.sub(r"```.*?```|`[^`]*`|\]\([^)]*\)", " ", text, flags=re.S)
    return re.sub(r"\s+", " ", text).lower()


def _names(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield every name that a module gives or uses, with its line."""
    for node in ast.walk(tree):
        for field in ("name", "id", "arg", "attr"):
            name = getattr(node, field, None)
            if isinstance(name, str):
                yield getattr(node, "lineno", 0), name


def _words(name: str) -> str:
    """Return a name as its words: ``_ShotAbout`` and ``shot_about`` are ``shot about``."""
    return " ".join(re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", name)).lower()


def _holds(text: str, word: str) -> bool:
    return re.search(rf"\b{word}\b", text) is not None


@pytest.mark.parametrize("page", _files("*.md"), ids=lambda page: str(page.relative_to(ROOT)))
def test_a_page_has_the_field_s_words(page: Path) -> None:
    """No page has a word that only this project understands."""
    prose = _prose(page.read_text(encoding="utf-8"))
    found = {word: say for word, say in (EVERYWHERE | IN_PROSE).items() if _holds(prose, word)}
    assert not found, f"say instead: {found}"


@pytest.mark.parametrize("package", ["analysis", "drivers", "impactd"])
def test_names_have_the_field_s_words(package: str) -> None:
    """No function, class, argument or variable has such a word as a part."""
    found = [
        f"{path.relative_to(ROOT)}:{line}: {name}: say {say}"
        for path in _files(f"{package}/*.py")
        for line, name in _names(ast.parse(path.read_text(encoding="utf-8")))
        for word, say in EVERYWHERE.items()
        if _holds(_words(name), word)
    ]
    assert not found, "\n".join(found)
