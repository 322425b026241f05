"""A laboratory that issues certificates for signatures, and checks what was signed with them."""

from __future__ import annotations

import dataclasses
from datetime import UTC, datetime, timedelta
from io import BytesIO
from pathlib import Path
from typing import Any

from asn1crypto import x509 as asn1
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    NoEncryption,
    PrivateFormat,
    pkcs12,
)
from cryptography.x509.oid import NameOID
from pyhanko.pdf_utils.reader import PdfFileReader
from pyhanko.sign.validation import validate_pdf_signature
from pyhanko_certvalidator import ValidationContext

WHO = "Žofie Müllerová"
SECRET = "korrekt pferd"
DAY = timedelta(days=1)


@dataclasses.dataclass(frozen=True)
class Laboratory:
    """A certification authority that issues certificates for signatures."""

    folder: Path
    key: ec.EllipticCurvePrivateKey
    root: x509.Certificate

    @classmethod
    def founded_in(cls, folder: Path) -> Laboratory:
        """Return it with a new key."""
        key = ec.generate_private_key(ec.SECP256R1())
        return cls(folder, key, _certificate("Our CA", key, "Our CA", key, ca=True))

    def issue(self, **changed: Any) -> tuple[ec.EllipticCurvePrivateKey, x509.Certificate]:
        """Return a technician's key and its certificate."""
        key = ec.generate_private_key(ec.SECP256R1())
        return key, _certificate(WHO, key, "Our CA", self.key, **changed)

    def pkcs12(self, secret: str | None = SECRET, **changed: Any) -> Path:
        """Return a file with key, certificate and the authority's certificate."""
        key, own = self.issue(**changed)
        cipher = BestAvailableEncryption(secret.encode()) if secret else NoEncryption()
        file = self.folder / "technician.p12"
        made = pkcs12.serialize_key_and_certificates(b"key", key, own, [self.root], cipher)
        file.write_bytes(made)
        return file

    def pem(self, secret: str | None = SECRET) -> tuple[Path, Path]:
        """Return a file with the key, and one with the certificates."""
        key, own = self.issue()
        cipher = BestAvailableEncryption(secret.encode()) if secret else NoEncryption()
        files = self.folder / "key.pem", self.folder / "certificate.pem"
        files[0].write_bytes(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, cipher))
        files[1].write_bytes(b"".join(one.public_bytes(Encoding.PEM) for one in (own, self.root)))
        return files

    def check(self, pdf: bytes) -> Any:
        """Return pyHanko's verdict about the only signature of a PDF."""
        trust = ValidationContext(trust_roots=[asn1.Certificate.load(_der(self.root))])
        (signature,) = PdfFileReader(BytesIO(pdf)).embedded_signatures
        return validate_pdf_signature(signature, trust)


def _der(certificate: x509.Certificate) -> bytes:
    return certificate.public_bytes(Encoding.DER)


def _certificate(
    whose: str,
    key: ec.EllipticCurvePrivateKey,
    issuer: str,
    by: ec.EllipticCurvePrivateKey,
    *,
    ca: bool = False,
    begin: timedelta = -DAY,
    end: timedelta = 30 * DAY,
    signs: bool = True,
) -> x509.Certificate:
    def name(words: str) -> x509.Name:
        return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, words)])

    now = datetime.now(UTC)
    use = x509.KeyUsage(
        digital_signature=signs, content_commitment=signs, key_encipherment=False,
        data_encipherment=False, key_agreement=not signs, key_cert_sign=ca, crl_sign=ca,
        encipher_only=False, decipher_only=False,
    )  # fmt: skip
    return (
        x509.CertificateBuilder()
        .subject_name(name(whose))
        .issuer_name(name(issuer))
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now + begin - DAY)
        .not_valid_after(now + end)
        .add_extension(x509.BasicConstraints(ca=ca, path_length=None), critical=True)
        .add_extension(use, critical=True)
        .sign(by, hashes.SHA256())
    )
