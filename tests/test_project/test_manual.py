"""The manual is built whole: warnings are errors, links lead somewhere, nothing comes from afar."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from types import ModuleType
from urllib.parse import unquote, urlparse

import pytest
import uvicorn
from docutils.utils.math import MathError
from fastapi import Depends, FastAPI

from impactd.api.known_query import refuse_unknown_query
from impactd.api.routes import guides
from impactd.guides import files
from impactd.guides.files import DOWNLOADS, FIRST
from impactd.guides.mathml import mathml_of

ROOT = Path(__file__).parents[2]
GUIDES = ROOT / "impactd" / "guides"
FETCHED = {
    "script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src", "use": "href",
}  # fmt: skip
"""What a browser asks for by itself, and the attribute that says where."""


@dataclass
class Page(HTMLParser):
    """What one page of the site refers to."""

    links: set[str] = field(default_factory=set)
    fetched: set[str] = field(default_factory=set)
    ids: set[str] = field(default_factory=set)
    inline: list[str] = field(default_factory=list)
    equations: int = 0

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag refers to."""
        found = {name: value or "" for name, value in attrs}
        self.ids.update(found[name] for name in ("id", "name") if name in found)
        if tag == "a" and "href" in found:
            self.links.add(found["href"])
        if FETCHED.get(tag) in found:
            self.fetched.add(found[FETCHED[tag]])
        if tag == "style" or (tag == "script" and "src" not in found):
            self.inline.append(tag)
        self.inline += [name for name in found if name == "style" or name.startswith("on")]
        self.equations += tag == "math"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site as `make docs` builds it, from nothing."""
    folder = tmp_path_factory.mktemp("manual")
    made = subprocess.run(
        [
            sys.executable, "-m", "sphinx", "--quiet", "--fail-on-warning", "--keep-going",
            "--conf-dir", str(GUIDES), "--doctree-dir", str(folder / "doctrees"),
            str(ROOT), str(folder / "site"),
        ],
        cwd=ROOT, capture_output=True, text=True, check=False, timeout=200,
    )  # fmt: skip
    assert made.returncode == 0, made.stdout + made.stderr
    return folder / "site"


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[str, Page]:
    """Every page by its path in the site; files that pages link to are none."""
    found = {}
    for path in sorted(site.rglob("*.html")):
        name = path.relative_to(site).as_posix()
        if not name.startswith(DOWNLOADS):
            found[name] = Page()
            found[name].feed(path.read_text("utf-8"))
    return found


@pytest.fixture(scope="module")
def conf() -> ModuleType:
    """The manual's settings."""
    spec = importlib.util.spec_from_file_location("manual_conf", GUIDES / "conf.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _targets(page: str, links: set[str]) -> Iterator[tuple[str, str, str]]:
    """Yield (link, path in the site, place in the page) of each link within the site."""
    for link in links:
        parts = urlparse(link)
        if not parts.scheme and not parts.netloc:
            address, place = unquote(parts.path), parts.fragment
            whole = Path(page).parent / address if address else Path(page)
            steps: list[str] = []
            for step in whole.parts:
                if step == "..":
                    steps.pop()
                else:
                    steps.append(step)
            yield link, "/".join(steps), unquote(place)


def test_every_page_of_the_navigation_exists(pages: dict[str, Page], conf: ModuleType) -> None:
    """The list of the first page is the navigation, and each entry is a page of the site."""
    listed = [page for entries in conf.children().values() for _, page in entries]
    assert len(listed) == len(set(listed))
    assert listed[0] == "impactd/guides/tutorial"
    assert {f"{page}.html" for page in (*listed, conf.root_doc)} == set(pages) - {"search.html"}
    assert f"{conf.root_doc}.html" == FIRST


def test_no_link_within_the_site_is_broken(site: Path, pages: dict[str, Page]) -> None:
    """Each link leads to a file, and to a place in it where it names one."""
    broken = [
        f"{name}: {link}"
        for name, page in pages.items()
        for link, target, place in _targets(name, page.links | page.fetched)
        if not (site / target).is_file()
        or (place and target in pages and place not in pages[target].ids)
    ]
    assert not broken


def test_no_page_fetches_anything_from_another_host(site: Path, pages: dict[str, Page]) -> None:
    """Scripts, styles, pictures and fonts lie in the site."""
    for name, page in pages.items():
        assert not [one for one in page.fetched if urlparse(one).netloc], name
    for sheet in site.rglob("*.css"):
        text = sheet.read_text("utf-8")
        assert "url(http" not in text, sheet
        assert "@import" not in text, sheet


def test_no_page_has_an_inline_script_or_style(pages: dict[str, Page]) -> None:
    """The daemon's policy refuses them."""
    assert not {name: page.inline for name, page in pages.items() if page.inline}


def test_equations_are_in_the_page(pages: dict[str, Page]) -> None:
    """They are MathML: no script draws them."""
    assert pages["impactd/guides/theory.html"].equations > 20
    assert pages["impactd/guides/equations.html"].equations > 40
    assert pages["analysis/diagnosis/METHOD.html"].equations > 20


@pytest.fixture
def address(site: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The site behind the daemon's own routes, with its policy."""
    monkeypatch.setattr(files, "SITE", site)
    files._files.cache_clear()
    app = FastAPI(dependencies=[Depends(refuse_unknown_query)])
    app.include_router(guides.router)
    server = uvicorn.Server(uvicorn.Config(app, port=0, log_config=None, lifespan="off"))
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        while not server.started:
            time.sleep(0.02)
        yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join()
        files._files.cache_clear()


def test_a_browser_shows_and_searches_the_manual_without_complaint(address, browser) -> None:
    """Nothing is refused by the policy, nobody else is asked, and the search finds a page."""
    complaints: list[str] = []
    asked: set[str] = set()
    tab = browser.new_page()
    tab.on("console", lambda message: complaints.append(message.text))
    tab.on("pageerror", lambda error: complaints.append(str(error)))
    tab.on("request", lambda request: asked.add(request.url.split("/")[2]))
    tab.goto(f"{address}/guides")
    tab.get_by_role("link", name="Theory of operation").first.click()
    tab.get_by_role("heading", name="Theory of operation").wait_for()
    tab.get_by_placeholder("Search").first.fill("Schur")
    tab.get_by_placeholder("Search").first.press("Enter")
    tab.locator("ul.search a", has_text="0007").first.wait_for()
    tab.close()
    assert complaints == []
    assert asked == {address.removeprefix("http://")}


@pytest.mark.parametrize(
    ("tex", "drawn"),
    [
        (r"\tfrac43 R", "<mn>4</mn> <mn>3</mn>"),
        (r"\frac{1}{16}", "<mn>1</mn> <mn>16</mn>"),
        (r"a_1 \dots a_9", "<mi>…</mi>"),
        (r"x^{12}", "<mn>12</mn>"),
    ],
)
def test_an_equation_is_drawn_as_tex_reads_it(tex: str, drawn: str) -> None:
    """One digit is one argument; what docutils lacks has another name."""
    assert drawn in " ".join(mathml_of(tex, as_block=False).split())


@pytest.mark.parametrize("tex", [r"x^12", r"\sqrt24", r"\frac1{x}", r"\unheardof"])
def test_an_equation_that_would_be_misread_is_refused(tex: str) -> None:
    """A warning fails the build; a wrong equation would not."""
    with pytest.raises(MathError):
        mathml_of(tex, as_block=True)


def test_every_effect_states_its_equations(site: Path) -> None:
    """The page of equations has the head of each file of the library."""
    text = (site / "impactd/guides/equations.html").read_text("utf-8")
    for file in (ROOT / "analysis" / "effects").glob("*.py"):
        if "\nEFFECT = " in file.read_text("utf-8"):
            assert f"<h3>{file.stem}<" in text
