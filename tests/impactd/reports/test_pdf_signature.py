"""A signed sheet of one modulus: pyHanko and poppler accept it, and no byte of it can change."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives.serialization import Encoding
from pypdf import PdfReader

from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from impactd.reports.pdf_signature import FIELD, SigningError, load_signatory
from tests.impactd.reports.laboratory import DAY, SECRET, WHO, Laboratory


@pytest.fixture
def laboratory(tmp_path: Path) -> Laboratory:
    """Return an authority that everybody here trusts."""
    return Laboratory.founded_in(tmp_path)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a campaign folder, small enough to be fitted at once."""
    settings = CampaignSettings(drop_heights_m=(0.02,), repeats=1)
    folder = tmp_path_factory.mktemp("campaign")
    return write_campaign_folder(folder, simulate_campaign(settings, 3))


@pytest.fixture
def budget(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Return `impactd budget` of that campaign, with nobody at a terminal."""

    def run(*words: object) -> subprocess.CompletedProcess[str]:
        """Run it."""
        command = [sys.executable, "-m", "impactd", "budget", campaign, *words]
        return subprocess.run(
            [str(word) for word in command],
            capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL, timeout=300,
        )  # fmt: skip

    monkeypatch.delenv("IMPACTD_SIGN_PASSPHRASE", raising=False)
    return run


def test_a_signed_sheet_is_accepted_until_a_byte_changes(
    laboratory: Laboratory, tmp_path: Path, budget: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """One page with the modulus; the visible field says who, when and why; one byte breaks it."""
    sheet = tmp_path / "sheet.pdf"
    monkeypatch.setenv("IMPACTD_SIGN_PASSPHRASE", SECRET)
    done = budget("--report", sheet, "--sign-with", laboratory.pkcs12(),
                  "--sign-reason", "Abnahme der Prüfung 4711")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert SECRET not in done.stdout + done.stderr

    signed = sheet.read_bytes()
    verdict = laboratory.check(signed)
    assert verdict.bottom_line, verdict.pretty_print_details()
    assert verdict.coverage.name == "ENTIRE_FILE"

    (page,) = PdfReader(BytesIO(signed)).pages
    assert "E of specimen = " in page.extract_text()
    (field,) = (one.get_object() for one in page["/Annots"])
    assert [round(float(edge)) for edge in field["/Rect"]] == list(FIELD)
    assert (field["/V"]["/Name"], field["/V"]["/Reason"]) == (WHO, "Abnahme der Prüfung 4711")
    assert abs(datetime.now(UTC) - verdict.signer_reported_dt) < timedelta(minutes=5)

    # of the sheet, and of the picture in the field
    for place in (signed.index(b"stream\n") + 20, signed.rindex(b"endstream\n") - 20):
        changed = bytearray(signed)
        changed[place] ^= 1
        assert not laboratory.check(bytes(changed)).intact
    if shutil.which("pdfsig"):
        assert "Signature is Valid" in _pdfsig(sheet)
        sheet.write_bytes(bytes(changed))
        assert "Digest Mismatch" in _pdfsig(sheet)


def _pdfsig(file: Path) -> str:
    """Return what poppler, which knows nothing of our authority, says of the signature."""
    words = ["pdfsig", "-nocert", str(file)]
    return subprocess.run(words, capture_output=True, text=True, check=False).stdout


def test_a_key_as_pem_signs_the_other_modulus(
    laboratory: Laboratory, tmp_path: Path, budget: Callable[..., Any]
) -> None:
    """Key and certificates as PEM, the passphrase in a file, E/(1-ν²) on the sheet."""
    sheet, secret = tmp_path / "sheet.pdf", tmp_path / "secret"
    secret.write_text(SECRET + "\n", encoding="utf-8")
    key, certificate = laboratory.pem()
    done = budget("--report", sheet, "--of", "plane-strain", "--sign-with", key,
                  "--sign-certificate", certificate, "--sign-passphrase-file", secret)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert laboratory.check(sheet.read_bytes()).bottom_line
    (page,) = PdfReader(sheet).pages
    assert re.search(r"E/\(1.ν²\) of specimen", page.extract_text())


def test_what_signs_nothing_is_refused_before_the_fit(
    laboratory: Laboratory, tmp_path: Path, budget: Callable[..., Any]
) -> None:
    """A page, no PDF, no passphrase, no key: one sentence each, and no file."""
    key, sheet = laboratory.pkcs12(), tmp_path / "sheet.pdf"
    for words, told in (
        (("--report", tmp_path / "page.html", "--sign-with", key), "--report FILE.pdf"),
        (("--sign-with", key), "--report FILE.pdf"),
        (("--report", sheet, "--sign-with", key), "needs a passphrase"),
        (("--report", sheet, "--sign-with", tmp_path / "none.p12"), "none.p12: No such file"),
    ):
        done = budget(*words)
        assert (done.returncode, done.stdout) == (1, ""), done
        assert told in done.stderr
        assert "Traceback" not in done.stderr
    assert not sheet.exists()


def test_without_the_extra_it_says_what_to_install(
    laboratory: Laboratory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The sentence names the extra."""
    monkeypatch.setitem(sys.modules, "pyhanko.sign.signers", None)
    with pytest.raises(SigningError, match=r"pip install 'impactd\[sign\]'"):
        load_signatory(laboratory.pkcs12(), None, SECRET, "")


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"end": -DAY}, "expired on"),
        ({"begin": 2 * DAY}, "is valid only from"),
        ({"signs": False}, "does not permit signatures"),
    ],
)
def test_a_certificate_that_does_not_hold_is_refused(
    laboratory: Laboratory, changed: dict[str, Any], said: str
) -> None:
    """Expired, not yet valid, for another use: its owner and the cause are named."""
    with pytest.raises(SigningError, match=f"CN={WHO} {said}"):
        load_signatory(laboratory.pkcs12(**changed), None, SECRET, "")


def test_what_does_not_open_or_belong_together_is_refused(
    laboratory: Laboratory, tmp_path: Path
) -> None:
    """A wrong passphrase, another's certificate, no certificate, no key at all."""
    both, (key, certificate) = laboratory.pkcs12(), laboratory.pem()
    other = tmp_path / "other.pem"
    other.write_bytes(laboratory.issue()[1].public_bytes(Encoding.PEM))
    rubbish = tmp_path / "rubbish.p12"
    rubbish.write_bytes(b"rubbish")
    for files, secret, said in (
        ((both, None), "wrong", "technician.p12 cannot be opened: the passphrase is wrong"),
        ((both, None), None, "technician.p12 cannot be opened: it needs a passphrase"),
        ((key, certificate), "wrong", "key.pem cannot be opened: the passphrase is wrong"),
        ((key, certificate), None, "key.pem cannot be opened: it needs a passphrase"),
        ((key, other), SECRET, "other.pem belongs to the key in"),
        ((key, None), SECRET, "no certificate; give"),
        ((certificate, None), SECRET, "holds no key"),
        ((rubbish, None), SECRET, "holds no key"),
    ):
        with pytest.raises(SigningError, match=said):
            load_signatory(*files, secret, "")
    key, certificate = laboratory.pem(secret=None)
    with pytest.raises(SigningError, match="has no passphrase; give none"):
        load_signatory(key, certificate, SECRET, "")
    assert load_signatory(key, certificate, None, "").name == WHO
