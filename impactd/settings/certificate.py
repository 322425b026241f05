"""The section of the settings file that says who signs a calibration certificate, and for whom.

Every key may be missing: the daemon needs none. `impactd certificate write` needs most of them
and says which one is missing, because a certificate states nothing that nobody told it.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from impactd.settings.keys import Section, choice

_Words = Annotated[str, StringConstraints(pattern=r"^\S+(\s+\S+)*$", max_length=300)]
_Country = Annotated[str, StringConstraints(pattern=r"^[A-Z]{2}$")]


class Contact(Section):
    """A laboratory or a customer, with an address."""

    name: _Words = choice("Name")
    street: _Words | None = choice("Street and number", default=None)
    post_code: _Words | None = choice("Post code", default=None)
    city: _Words = choice("City")
    country_code: _Country = choice('Country by ISO 3166-1, two capitals: "DE"')
    e_mail: _Words | None = choice("E-mail address", default=None)


class CertificateSection(Section):
    """Who calibrates, who answers for it, and for whom."""

    laboratory: Contact | None = choice("The laboratory that calibrates", default=None)
    customer: Contact | None = choice("Whom the certificate is for", default=None)
    responsible: _Words | None = choice("The person who answers for certificates", default=None)
    role: _Words | None = choice("That person's role", default=None)
    performance_location: (
        Literal["laboratory", "customer", "laboratoryBranch", "customerBranch", "other"] | None
    ) = Field(
        description="Where the rig stands, in the words of the DCC",
        default=None,
    )
    cell_manufacturer: _Words | None = choice("Maker of the load cell", default=None)
    cell_model: _Words | None = choice("Model of the load cell", default=None)
