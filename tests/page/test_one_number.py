"""One number everywhere: page, terminal, JSON, CSV, report and PDF of the same drops."""

from __future__ import annotations

import csv
import html
import json
import math
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pypdf
import pytest
from scipy.stats import norm

from analysis.written_numbers import K_95, measured
from impactd.client.connection import Connection
from impactd.client.talk import fresh_key
from tests.page.conftest import DESKTOP, Daemon, Visitor

YOUNG, PLANE = "youngs_modulus_Pa", "plane_strain_modulus_Pa"
MATERIALS = ("specimen", "acetal", "acetal_small", "aluminium")
_PRINTED = re.compile(r"(-?\d+(?:\.\d+)?) (?:±|\+-) (\d+(?:\.\d+)?)")
_ENDED = ("analysed", "failed", "aborted", "interrupted")


@dataclass(frozen=True)
class Drops:
    """A daemon that has measured, and a folder for what its commands write."""

    daemon: Daemon
    token: str
    shots: tuple[int, ...]
    folder: Path

    def command(self, *words: object) -> str:
        """Return what a command prints."""
        made = subprocess.run(
            [sys.executable, "-m", "impactd", *map(str, words)],
            env={**os.environ, "IMPACTD_URL": self.daemon.url, "IMPACTD_TOKEN": self.token},
            capture_output=True,
            text=True,
            check=False,
        )
        assert made.returncode == 0, made.stderr
        return made.stdout

    def json(self, name: str) -> dict:
        """Return a file that a command wrote."""
        return json.loads((self.folder / name).read_text())


@pytest.fixture(scope="module")
def drops(tmp_path_factory, chromium):
    """Two spheres on a reference and on the specimen, from two heights."""
    daemon = Daemon(tmp_path_factory.mktemp("daemon"))
    try:
        daemon.start()
        token, shots = daemon.token(), []
        with Connection(daemon.url, token) as client:
            for height_m in (0.0115, 0.0465):
                for sphere in ("acetal", "acetal_small"):
                    for surface in ("aluminium", "specimen"):
                        pair = {"sphere": sphere, "surface": surface}
                        body = {**pair, "drop_height_m": height_m, "operator": "Ada"}
                        made = client.send("POST", "/v1/drops", body, key=fresh_key())
                        ended = client.wait(
                            f"/v1/drops/{made['number']}",
                            lambda drop: drop["state"] in _ENDED,
                            lambda _state, _share: None,
                        )
                        assert ended["state"] == "analysed", ended
                        shots.append(ended["shot"])
        yield Drops(daemon, token, tuple(shots), tmp_path_factory.mktemp("written"))
    finally:
        daemon.stop()


@pytest.fixture
def results(drops, browser):
    """The page of that daemon."""
    one = Visitor(drops.daemon, browser, size=DESKTOP)
    one.sign_in()
    yield one
    one.context.close()


def printed(text: str) -> tuple[str, str]:
    """Return the one value and its U in a text, digit by digit."""
    ((value, expanded),) = _PRINTED.findall(text)
    return value, expanded


def line_of(text: str, name: str) -> list[tuple[str, str]]:
    """Return every value and U in the line of a table that begins with a name."""
    (line,) = (one for one in text.splitlines() if re.match(rf"{re.escape(name)}\s", one))
    return _PRINTED.findall(line)


def in_gigapascals(quantity: dict) -> tuple[str, str]:
    """Return what the JSON's modulus is when both end at the second digit of U."""
    expanded = quantity.get("expanded", {"k": K_95, "U": K_95 * quantity["u"]})
    assert math.isclose(expanded["U"], expanded["k"] * quantity["u"], rel_tol=1e-12)
    places = 1 - math.floor(math.log10(expanded["U"] * 1e-9))
    return f"{quantity['value'] * 1e-9:.{places}f}", f"{expanded['U'] * 1e-9:.{places}f}"


def rows_of(file: Path) -> dict[tuple[str, str], dict[str, str]]:
    """Return the lines of a command's CSV by name and quantity."""
    with file.open(encoding="utf-8-sig", newline="") as lines:
        return {(row["name"], row["quantity"]): row for row in csv.DictReader(lines)}


def holds(row: dict[str, str], quantity: dict) -> bool:
    """Tell whether a line of CSV is a quantity of the JSON to the last bit."""
    return (
        float(row["value"]) == quantity["value"]
        and float(row["u"]) == quantity["u"]
        and [float(row["low95"]), float(row["high95"])] == quantity["interval95"]
    )


def test_the_moduli_of_all_shots(drops, results):
    """Results view, `impactd moduli`, its JSON and CSV, and the budget under the card."""
    said = drops.command("moduli", "--csv", drops.folder / "moduli.csv")
    found = json.loads(drops.command("moduli", "--json"))
    table = rows_of(drops.folder / "moduli.csv")
    results.go("Results")
    for name in MATERIALS:
        entry = found["moduli"][name]
        card = results.page.get_by_role("region", name=name.replace("_", " "), exact=True)
        young, plane = in_gigapascals(entry[YOUNG]), in_gigapascals(entry[PLANE])
        assert printed(card.locator(".modulus").inner_text()) == young
        assert printed(card.get_by_text("E/(1−ν²) =").inner_text()) == plane
        stated = entry.get("stated_youngs_modulus_Pa")
        listed = [young, plane]
        if stated:
            listed.append(in_gigapascals(stated))
            assert printed(card.get_by_text("Stated value").inner_text()) == listed[2]
        assert line_of(said, name) == listed
        assert holds(table[name, YOUNG], entry[YOUNG])
        assert holds(table[name, PLANE], entry[PLANE])
    card = results.page.get_by_role("region", name="specimen", exact=True)
    card.get_by_text("Uncertainty budget").click()
    heads = card.get_by_role("heading", level=3).filter(has_text="±")
    heads.first.wait_for()
    entry = found["moduli"]["specimen"]
    assert [printed(one) for one in heads.all_inner_texts()] == [
        in_gigapascals(entry[key]) for key in (YOUNG, PLANE)
    ]
    for pair in found["pairs"].values():
        words = f"{pair['sphere']} on {pair['surface']}".replace("_", " ")
        row = results.page.get_by_role("row").filter(
            has=results.page.get_by_role("rowheader", name=words, exact=True)
        )
        mean = pair["reduced_modulus_Pa"]
        assert printed(row.inner_text()) == in_gigapascals(mean)
        assert holds(table[f"{pair['sphere']}/{pair['surface']}", "reduced_modulus_Pa"], mean)
    results.assert_clean()


def test_one_shot(drops, results):
    """Its own view, the list, `impactd shots N`, its JSON, and the selection as CSV and JSON."""
    number = drops.shots[1]
    shot = json.loads(drops.command("shots", number, "--json"))
    (closed,) = (fit for fit in shot["fits"] if fit["model"] == "kv2")
    quantity = closed["result"]["reduced_modulus_Pa"]
    told = in_gigapascals(quantity)
    lines = drops.command("shots", number).splitlines()
    listed = [line for line in lines if " kv2 " in line]
    assert f"peak            {shot['peak']:.4g}" in lines
    assert printed(listed[0]) == told
    page = results.page
    page.goto(f"{drops.daemon.url}/#/shots/{number}")
    results.shot(number)
    assert printed(page.locator(".verdict .modulus").inner_text()) == told
    results.go("Shots")
    row = page.get_by_role("row").filter(has=page.get_by_role("link", name=str(number), exact=True))
    assert printed(row.inner_text()) == told
    results.go("Results")
    taken = page.get_by_role("region", name="Take away")
    taken.get_by_label("Shots").fill(str(number))
    for form in ("csv", "json"):
        taken.get_by_label("As").select_option(form)
        with page.expect_download() as caught:
            taken.get_by_role("link", name="Download").click()
        text = caught.value.path().read_text()
        if form == "csv":
            lines = [line for line in text.splitlines() if not line.startswith("#")]
            (one,) = csv.DictReader(lines)
        else:
            (one,) = json.loads(text)["shots"]
        assert float(one["reduced_modulus_Pa"]) == quantity["value"]
        assert float(one["u_Pa"]) == quantity["u"]
        assert float(one["expanded_95_Pa"]) == quantity["expanded"]["U"]
    results.assert_clean()


def test_a_joint_fit(drops):
    """`impactd fit` of the shots, its JSON and CSV, the same of their export, and `budget`.

    The moduli of all shots are another estimate: a network of single fits. Both agree within U.
    """
    files = {one: drops.folder / f"fit.{one}" for one in ("json", "csv")}
    options = [word for one, file in files.items() for word in (f"--{one}", file)]
    said = drops.command("fit", *drops.shots, *options)
    found, table = drops.json("fit.json"), rows_of(files["csv"])
    where = ("--config", drops.daemon.config, "--data", drops.daemon.data)
    drops.command("export", *drops.shots, "--out", drops.folder / "shots", *where)
    exported = drops.command("fit", drops.folder / "shots/campaign.json")
    budgets = drops.command(
        "budget", drops.folder / "shots/campaign.json", "--specimen", "specimen"
    )
    network = json.loads(drops.command("moduli", "--json"))["moduli"]
    for name in MATERIALS:
        entry = found["moduli"][name]
        told = [in_gigapascals(entry[key]) for key in (YOUNG, PLANE)]
        assert line_of(said, name)[:2] == told
        assert line_of(exported, name)[:2] == told
        assert holds(table[name, YOUNG], entry[YOUNG])
        for key in (YOUNG, PLANE):
            apart = abs(entry[key]["value"] - network[name][key]["value"])
            assert apart < network[name][key]["expanded"]["U"]
    for name, pair in found["pairs"].items():
        assert line_of(said, name) == [in_gigapascals(pair["reduced_modulus_Pa"])]
        assert line_of(exported, name) == line_of(said, name)
    for symbol, key in (("E", YOUNG), ("E/(1-nu^2)", PLANE)):
        heads = [one for one in budgets.splitlines() if one.startswith(f"{symbol} of specimen =")]
        assert printed(heads[0]) == in_gigapascals(found["moduli"]["specimen"][key])


@pytest.mark.slow
def test_a_diagnosis(drops):
    """Terminal, JSON, CSV, report with its budget, and PDF; the same of the export.

    It fits the first hits alone, from the cell's certificate; a joint fit also fits later bounces.
    """
    endings = {"json": "json", "csv": "csv", "report": "html", "pdf": "pdf"}
    files = {one: drops.folder / f"found.{ending}" for one, ending in endings.items()}
    options = [word for one, file in files.items() for word in (f"--{one}", file)]
    said = drops.command("diagnose", *drops.shots, *options)
    found, table = drops.json("found.json"), rows_of(files["csv"])
    page = html.unescape(files["report"].read_text())
    (sheet,) = pypdf.PdfReader(files["pdf"]).pages
    paper = sheet.extract_text()
    drops.command("fit", *drops.shots, "--json", drops.folder / "fit.json")
    joint = drops.json("fit.json")["moduli"]
    assert f"k = {K_95:.3g} (95 %)" in paper
    for name in MATERIALS:
        entry = found["after"]["moduli"][name]
        told = [in_gigapascals(entry[key]) for key in (YOUNG, PLANE)]
        assert line_of(said, name)[:2] == told
        stated = entry.get("stated_youngs_modulus_Pa")
        listed = [*told, in_gigapascals(stated)] if stated else told
        assert line_of(paper, f"{name} {entry['status']}") == listed
        (row,) = re.findall(rf"<tr><td>{name}</td><td>{entry['status']}</td>.*</tr>", page)
        found_twice = _PRINTED.findall(row)[:2]  # what a reference was stated to be follows
        assert found_twice == [told[0], told[0]]  # nothing was found: before is after
        assert holds(table[name, YOUNG], entry[YOUNG])
        assert holds(table[name, PLANE], entry[PLANE])
        apart = abs(entry[PLANE]["value"] - joint[name][PLANE]["value"])
        assert apart < entry[PLANE]["expanded"]["U"]
    young, plane = (in_gigapascals(found["after"]["moduli"]["specimen"][k]) for k in (YOUNG, PLANE))
    assert f"<b>{young[0]} ± {young[1]} GPa</b>" in page
    assert f"E of specimen = {young[0]} ± {young[1]} GPa (95 %)" in page
    assert f"E/(1-ν²) of specimen = {plane[0]} ± {plane[1]} GPa (95 %)" in page
    where = ("--config", drops.daemon.config, "--data", drops.daemon.data)
    drops.command("export", *drops.shots, "--out", drops.folder / "again", *where)
    exported = drops.command("diagnose", drops.folder / "again/campaign.json")
    assert line_of(exported, "specimen")[:2] == [young, plane]


@pytest.mark.parametrize(
    "quantity",
    [
        {"value": 3.1415, "u": 0.02},
        {"value": 3.0, "u": 0.1, "expanded": {"U": 0.21}},
        {"value": 194.0, "u": 12.0},
        {"value": 1.0, "u": 0.0499},
        {"value": 7.13526e-4, "u": 3.6e-6},
        {"value": 1.25e-10, "u": 1.0e-11},
        {"value": -4.2e3, "u": 1.0e12},
        {"value": 4.42698e8, "u": 9.1e4},
        {"value": 89.0, "u": 60.0, "interval95": [12.0, 95.0]},
        {"value": 89.0, "u": 60.0, "interval95": [12.0, None]},
        {"value": 5.0, "u": 0.0},
    ],
)
def test_page_and_terminal_write_a_quantity_alike(results, quantity):
    """The two rules for digits are one, very large and small numbers included."""
    written = results.page.evaluate(
        "async (one) => (await import('/page/js/numbers.js')).measured(one)", quantity
    )
    assert written == measured(quantity, sign="±")


def test_there_is_one_coverage_factor():
    """What JSON, reports and terminal multiply u with is the normal distribution's own."""
    assert pytest.approx(norm.ppf(0.975), rel=1e-15) == K_95
