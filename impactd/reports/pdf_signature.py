"""A digital signature on a one-page PDF, with a field that shows who signed, when and why.

The signature is a PAdES baseline signature (ETSI EN 319 142-1), made by pyHanko. It covers every
byte of the file. Its time is this computer's: no time stamping authority is asked.
"""

# ruff: noqa: PLC0415 - an extra, and matplotlib: imported for a signature only

from __future__ import annotations

import io
import tempfile
import textwrap
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

if TYPE_CHECKING:
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization.pkcs12 import PKCS12PrivateKeyTypes
    from pyhanko.sign.signers import SimpleSigner

FIELD = (545, 11, 800, 41)
"""Left, lower, right and upper edge of the field on a lying A4, beside the foot. [point]"""
_LINE = 64
"""Letters of a line in the field."""


class SigningError(Exception):
    """A sheet cannot be signed; the message says why and what to do."""


class PassphraseMissingError(SigningError):
    """The key needs a passphrase, and none was given."""


@dataclass(frozen=True)
class Signatory:
    """Who signs, with what, and why."""

    name: str
    """As the certificate states it."""
    reason: str
    signer: SimpleSigner

    def sign(self, sheet: bytes) -> bytes:
        """Return a one-page PDF with the signature; what was there keeps its bytes."""
        from pyhanko.pdf_utils import layout
        from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
        from pyhanko.sign import PdfSignatureMetadata, PdfSigner
        from pyhanko.sign.fields import SigFieldSpec, SigSeedSubFilter
        from pyhanko.stamp import StaticStampStyle

        metadata = PdfSignatureMetadata(
            field_name="Signature",
            name=self.name,
            reason=self.reason,
            subfilter=SigSeedSubFilter.PADES,
        )
        with tempfile.TemporaryDirectory() as folder:
            picture = Path(folder, "field.pdf")
            self._draw(picture)
            filling = layout.SimpleBoxLayoutRule(
                layout.AxisAlignment.ALIGN_MID, layout.AxisAlignment.ALIGN_MID
            )
            drawn = StaticStampStyle.from_pdf_file(
                str(picture), border_width=0, background_layout=filling
            )
            signing = PdfSigner(
                metadata,
                self.signer,
                stamp_style=drawn,
                new_field_spec=SigFieldSpec("Signature", box=FIELD),
            )
            signed = signing.sign_pdf(IncrementalPdfFileWriter(io.BytesIO(sheet)))
        return bytes(signed.getvalue())

    def _draw(self, file: Path) -> None:
        """Draw the field; pyHanko's own text knows Latin letters only."""
        from matplotlib.figure import Figure

        from analysis.plots.style import AFTER, INK, styled

        left, lower, right, upper = FIELD
        lines = (
            f"Digitally signed by {self.name}",
            f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC, by the clock of the signing computer",
            f"Reason: {self.reason}",
        )
        said = "\n".join(textwrap.shorten(one, _LINE, placeholder=" …") for one in lines)
        with styled():
            figure = Figure(figsize=((right - left) / 72, (upper - lower) / 72))
            figure.patch.set(edgecolor=AFTER, linewidth=1.2)
            figure.text(0.02, 0.5, said, size=7, color=INK, va="center", parse_math=False)
            figure.savefig(file)


def load_signatory(
    key_file: Path, certificate_file: Path | None, passphrase: str | None, reason: str
) -> Signatory:
    """Return who signs.

    Parameters
    ----------
    key_file : Path
        PKCS#12 with key and certificate, or a key as PEM.
    certificate_file : Path or None
        The certificate and those of its issuers as PEM; None where the file of the key has them.
    passphrase : str or None
        Of the key.
    reason : str
        Stands in the field and in the signature.

    Raises
    ------
    PassphraseMissingError
        If the key needs one.
    SigningError
        If the extra is missing, the passphrase is wrong, or key and certificate do not sign now.
    OSError
        If a file cannot be read.
    """
    try:
        import pyhanko.sign.signers  # noqa: F401 - whether it is there
    except ImportError:
        raise SigningError(
            "A signature needs pyHanko, which is not installed: pip install 'impactd[sign]'."
        ) from None
    from cryptography.hazmat.primitives.serialization import NoEncryption, pkcs12
    from cryptography.x509.oid import NameOID
    from pyhanko.sign.signers import SimpleSigner

    key, certificates = _read(key_file, certificate_file, passphrase)
    own = next((one for one in certificates if one.public_key() == key.public_key()), None)
    if own is None:
        raise SigningError(
            f"None of the {len(certificates)} certificates in {certificate_file or key_file} "
            f"belongs to the key in {key_file}; name the one that was issued for it."
        )
    _require_usable(own)
    issuers = [one for one in certificates if one is not own]
    together = pkcs12.serialize_key_and_certificates(None, key, own, issuers, NoEncryption())
    signer = SimpleSigner.load_pkcs12_data(together, [])
    names = own.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    name = str(names[0].value) if names else own.subject.rfc4514_string()
    return Signatory(name, reason, signer)


def _read(
    key_file: Path, certificate_file: Path | None, passphrase: str | None
) -> tuple[PKCS12PrivateKeyTypes, list[x509.Certificate]]:
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import load_pem_private_key, pkcs12

    content = key_file.read_bytes()
    secret = passphrase.encode() if passphrase else None
    closed = f"The key in {key_file} cannot be opened: "
    wrong = SigningError(f"{closed}the passphrase is wrong.")
    if secret is None:
        wrong = PassphraseMissingError(f"{closed}it needs a passphrase, and none was given.")
    try:
        if b"-----BEGIN" in content:
            key: Any = load_pem_private_key(content, secret)
            pem = certificate_file.read_bytes() if certificate_file else content
            certificates = x509.load_pem_x509_certificates(pem)
        else:
            key, own, more = pkcs12.load_key_and_certificates(content, secret)
            certificates = [one for one in (own, *more) if one]
            if certificate_file:
                certificates += x509.load_pem_x509_certificates(certificate_file.read_bytes())
    except TypeError as error:
        if secret is None:
            raise wrong from error
        raise SigningError(f"The key in {key_file} has no passphrase; give none.") from error
    except ValueError as error:
        if "password" in str(error):
            raise wrong from error
        raise SigningError(
            f"{key_file} holds no key, or {certificate_file or 'it'} no certificate; give a "
            "PKCS#12 file (.p12, .pfx), or a key and its certificate as PEM."
        ) from error
    if not isinstance(key, get_args(pkcs12.PKCS12PrivateKeyTypes)):
        raise SigningError(f"{key_file} has no key that signs: one of RSA, EC, Ed25519 or Ed448.")
    return key, certificates


def _require_usable(certificate: x509.Certificate) -> None:
    from cryptography import x509

    now = datetime.now(UTC)
    begin, end = certificate.not_valid_before_utc, certificate.not_valid_after_utc
    whose = f"The certificate of {certificate.subject.rfc4514_string()}"
    if now > end:
        raise SigningError(f"{whose} expired on {end:%Y-%m-%d %H:%M} UTC; renew it.")
    if now < begin:
        raise SigningError(
            f"{whose} is valid only from {begin:%Y-%m-%d %H:%M} UTC, and it is "
            f"{now:%Y-%m-%d %H:%M} UTC; wait, or set the clock."
        )
    try:
        use = certificate.extensions.get_extension_for_class(x509.KeyUsage).value
    except x509.ExtensionNotFound:
        return
    if not (use.digital_signature or use.content_commitment):
        raise SigningError(
            f"{whose} does not permit signatures (its key usage says so); use one that does."
        )
