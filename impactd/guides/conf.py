"""How Sphinx makes the manual: every Markdown page of the repository is a page where it lies.

The source folder is the top of the repository, so no page is copied and a link between two pages is
the same here and on the source host. ``README.md`` in this folder lists the pages; its list is the
navigation.
"""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

from analysis import nomenclature

ROOT = Path(__file__).parents[2]

project = "impactd"
copyright = "the impactd founders"
root_doc = "impactd/guides/README"
extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc", "impactd.guides.mathml"]

source_suffix = {".md": "markdown"}
include_patterns = [
    "README.md",
    "CHANGELOG.md",
    *(f"{folder}/**.md" for folder in ("impactd", "drivers", "analysis", "config", "systemd")),
    "tests/*.md",
]
exclude_patterns = [
    ".*",
    "build",
    "dist",
    "impactd-*",
    "my-campaign",
    "impactd/guides/site",
    "impactd/reports/templates",  # of pages: `impactd paper` and the reports fill them in
]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4  # the same addresses of headings as on the source host
myst_dmath_double_inline = True
numpydoc_show_class_members = False
autosummary_generate = False  # numpydoc loads it; no page is made of it
html_math_renderer = "mathml"

html_theme = "furo"
html_title = "impactd: the manual"
html_favicon = "../page/static/css/icon.svg"
html_static_path = ["static"]
html_css_files = ["colours.css"]
templates_path = ["theme"]
html_copy_source = False
html_show_sphinx = False
html_use_index = False
html_domain_indices = False

INDEXES = (root_doc, "impactd/decisions/README")
"""Pages whose lists of links are the navigation."""
_ENTRY = re.compile(r"^( *)[-*] \[([^\]]+)\]\(([^)#]+)\.md\)", flags=re.M)
EQUATIONS = "impactd/guides/equations"
"""The page to which the head of every effect's file is added."""
GLOSSARY_PAGE = "impactd/guides/glossary"
"""The page to which the symbols of the analysis are added."""


def children() -> dict[str, list[tuple[str, str]]]:
    """Return the (title, page) below each page, from the lists of the index pages."""
    found: dict[str, list[tuple[str, str]]] = {}
    for index in INDEXES:
        parents = [(-1, index)]
        for indent, title, target in _ENTRY.findall((ROOT / f"{index}.md").read_text("utf-8")):
            page = _from_top(index, target)
            while parents[-1][0] >= len(indent):
                parents.pop()
            found.setdefault(parents[-1][1], []).append((title, page))
            parents.append((len(indent), page))
    return found


def _from_top(page: str, target: str) -> str:
    """Return a page's path from the top of the repository, as another page links to it."""
    parts: list[str] = []
    for part in (PurePosixPath(page).parent / target).parts:
        if part == "..":
            parts.pop()
        else:
            parts.append(part)
    return "/".join(parts)


def _add_navigation(_app: object, page: str, content: list[str]) -> None:
    entries = children().get(page, [])
    if entries:
        listed = "\n".join(f"{title} </{target}>" for title, target in entries)
        content[0] += f"\n\n```{{toctree}}\n:hidden:\n\n{listed}\n```\n"


def _add_effects(_app: object, page: str, content: list[str]) -> None:
    """Add the head of each effect's file, which states its equation, source and validity."""
    if page != EQUATIONS:
        return
    for file in sorted((ROOT / "analysis" / "effects").glob("*.py")):
        if "\nEFFECT = " in file.read_text("utf-8"):
            name = f"analysis.effects.{file.stem}"
            content[0] += f"\n### {file.stem}\n\n```{{eval-rst}}\n.. automodule:: {name}\n```\n"


def _add_symbols(_app: object, page: str, content: list[str]) -> None:
    """Add the table of symbols from the analysis' own list."""
    if page != GLOSSARY_PAGE:
        return
    content[0] += "\n| symbol | meaning | unit | in the code | source |\n|---|---|---|---|---|\n"
    for term in nomenclature.GLOSSARY:
        cells = (f"`{term.symbol}`", term.meaning, term.unit, f"`{term.name}`", term.source)
        content[0] += f"| {' | '.join(cells)} |\n"


def _plain_references(
    _app: object, _what: str, _name: str, _obj: object, _options: object, lines: list[str]
) -> None:
    """Keep the references of a docstring as text: several docstrings number theirs on one page."""
    text = re.sub(r"(\[\d+\])_", r"\1", "\n".join(lines))
    text = re.sub(r"^References\n-+$", ".. rubric:: References\n", text, flags=re.M)
    text = re.sub(
        r"^\.\. (\[\d+\] .*(?:\n {3}.*)*)",
        lambda found: re.sub(r"\n +", "\n", found[1]) + "\n",
        text,
        flags=re.M,
    )
    lines[:] = text.split("\n")


def setup(app: Sphinx) -> None:
    """Connect what the build adds to pages."""
    app.connect("autodoc-process-docstring", _plain_references, priority=400)  # before numpydoc
    for add in (_add_effects, _add_symbols, _add_navigation):
        app.connect("source-read", add)
    app.add_lexer("mermaid", TextLexer)  # a diagram stays the text that it is made of
