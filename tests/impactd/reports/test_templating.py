"""What every template may rely on: escaping, numbers, and nothing left blank by mistake."""

from __future__ import annotations

from importlib import resources

import pytest
from jinja2 import UndefinedError

from impactd.reports.templating import gigapascals, number, p_value, percent, render

PAGES = [
    entry.name
    for entry in resources.files("impactd.reports").joinpath("templates").iterdir()
    if entry.name.endswith(".html")
]
TYPED = "<script>alert(1)</script> & co"


def budget(improve: str) -> dict[str, object]:
    """Return the least that a page of budgets wants."""
    modulus = {
        "value": 1e9,
        "u": 1e7,
        "relative_u": 0.01,
        "relative_u_common": 0.0,
        "relative_u_averaged": 0.01,
        "improve": improve,
        "rows": [],
    }
    return {"moduli": {"pvc": {"youngs_modulus_Pa": modulus}}, "software": "impactd"}


def test_what_a_document_says_is_no_markup_in_html() -> None:
    """Also inside a macro of another file."""
    made = render("budget.html", document=budget(TYPED), names=["pvc"], about=TYPED)
    assert "<script>" not in made
    assert made.count("&lt;script&gt;alert(1)&lt;/script&gt; &amp; co") == 2


def test_markdown_stays_as_it_is() -> None:
    """Its readers take `<` for itself; only the bar that ends a cell is escaped."""
    claim = dict.fromkeys(("where", "says", "claimed", "ours", "note"), "a < b | c")
    made = render("claims.md", claims=[{**claim, "verdict": "does not hold"}])
    assert made.count("a < b \\| c") == 5
    assert "**does not** hold" in made


def test_a_value_that_is_missing_is_an_error() -> None:
    """A page with a hole in it is worse than none."""
    with pytest.raises(UndefinedError, match="names"):
        render("budget.html", document=budget(""), about="")


@pytest.mark.parametrize("name", PAGES)
def test_no_page_asks_a_network(name: str) -> None:
    """Whoever opens a report, offline or years later, sees all of it; what it runs is no page's."""
    text = resources.files("impactd.reports").joinpath("templates", name).read_text("utf-8")
    assert "://" not in text
    assert "<script" not in text.replace('<script type="application/json"', "")


def test_numbers_are_written_in_one_way() -> None:
    """Without a value a dash; a modulus in GPa with its expanded uncertainty."""
    assert number(0.0015, ".3g", 1e3) == "1.5"
    assert number(None, ".3g") == "-"
    assert percent(0.1234) == "12.3 %"
    assert (p_value(0.0301), p_value(0.0)) == ("p = 0.03", "p < 1e-99")
    assert gigapascals({"value": 3.15e9, "u": 0.12e9}) == "3.15 ± 0.24"
    assert gigapascals(None) == "-"
