"""The sheet for the file: one page that says what the JSON says."""

from __future__ import annotations

import copy
import json
import subprocess
import sys
from datetime import UTC, datetime

import pypdf
import pytest

from analysis.written_numbers import measured
from impactd.diagnosis.result_sheet import Source, write_result_sheet
from impactd.storage.campaign_digest import campaign_files, digest_of

MADE = datetime(2026, 3, 4, 5, 6, tzinfo=UTC)


@pytest.fixture
def written(tmp_path):
    """Return a maker of sheets, which gives a sheet's words with single blanks."""

    def write(document, name="A campaign", files=None):
        file = tmp_path / "sheet.pdf"
        source = Source(name, files or {"campaign.json": "0" * 64})
        write_result_sheet(file, document, source, MADE)
        (page,) = pypdf.PdfReader(file).pages
        return " ".join(page.extract_text().split())

    return write


def test_the_command_writes_one_page_with_what_the_json_says(leaky_campaign, tmp_path):
    """Verdict, every modulus with k, model, version, name of the campaign and its digest."""
    sheet, out = tmp_path / "sheet.pdf", tmp_path / "found.json"
    command = [sys.executable, "-m", "impactd", "diagnose", leaky_campaign]
    made = subprocess.run(
        [*command, "--json", out, "--pdf", sheet],
        capture_output=True,
        text=True,
        check=False,
        timeout=240,
    )
    assert made.returncode == 0, made.stderr
    assert made.stdout.endswith(f"PDF: {sheet}\n")
    found = json.loads(out.read_text())
    (page,) = pypdf.PdfReader(sheet).pages
    text = " ".join(page.extract_text().split())
    for said in (
        leaky_campaign.parent.name,
        "IDENTIFIED",
        found["sentence"],
        "k = 1.96 (95 %)",
        found["after"]["model"],
        found["software"],
        datetime.now(UTC).strftime("%Y-"),
        digest_of(campaign_files(leaky_campaign)),
    ):
        assert said in text
    for name, entry in found["after"]["moduli"].items():
        young, plane = (
            measured(entry[key], scale=1e-9, sign="±")
            for key in ("youngs_modulus_Pa", "plane_strain_modulus_Pa")
        )
        assert f"{name} {entry['status']} {young} {plane}" in text


def test_the_digest_is_that_of_sha256sum(leaky_campaign):
    """Anybody can compute it again; a file that changes changes it."""
    folder = leaky_campaign.parent
    listed = subprocess.run(
        "LC_ALL=C sha256sum campaign.json *.npy | sha256sum",
        shell=True,
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    files = campaign_files(folder)
    assert listed.stdout.split()[0] == digest_of(files)
    assert digest_of({**files, "campaign.json": "1" * 64}) != digest_of(files)


def test_the_same_result_gives_the_same_bytes(document, tmp_path):
    """Its date is the one that was given."""
    sheets = [tmp_path / name for name in ("a.pdf", "b.pdf")]
    for sheet in sheets:
        write_result_sheet(sheet, document, Source("A campaign", {"a": "0"}), MADE)
    assert sheets[0].read_bytes() == sheets[1].read_bytes()
    text = pypdf.PdfReader(sheets[0]).pages[0].extract_text()
    assert "Result of 2026-03-04 05:06 UTC" in text


def test_a_long_verdict_and_many_materials_stay_on_the_page(document, written):
    """Letters shrink; nothing is left out."""
    long = copy.deepcopy(document)
    long["sentence"] = " ".join(f"Sentence {place}." for place in range(200))
    entry = long["after"]["moduli"]["specimen"]
    long["after"]["moduli"] |= {f"coupon{place}": entry for place in range(30)}
    text = written(long)
    assert "Sentence 199." in text
    assert "coupon29 fitted" in text


def test_without_moduli_or_residual_there_is_a_sheet(document, written):
    """A withheld modulus is called so; what was typed is no formula."""
    bare = copy.deepcopy(document)
    bare["after"]["moduli"] = {
        "specimen": {"status": "withheld", "youngs_modulus_Pa": None, "reason": "State it."}
    }
    bare["residual"]["before"].pop("stacks")
    text = written(bare, name="costs $5 and $6_a")
    assert "specimen withheld - -" in text
    assert "costs $5 and $6_a" in text
