"""Spheres and surfaces a rig knows, from ``config/materials.toml``."""

from __future__ import annotations

import difflib
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    field_validator,
)

from analysis.campaign import STATED_AT_C, Quantity, Sphere, Surface, Uncertainty
from impactd.settings.ball_grades import diameter_tolerance_m, grades, rectangular_u
from impactd.settings.errors import SettingsError, SettingsFinding
from impactd.storage.ranges import MODULUS_COEFFICIENT_PER_K, TEMPERATURE_C


class UnknownMaterialError(Exception):
    """A sphere or surface is not in the materials file."""

    def __init__(self, role: str, name: str, known: tuple[str, ...]) -> None:
        self.role = role
        self.name = name
        self.known = known
        close = difflib.get_close_matches(name, known, n=1)
        hint = f" Did you mean {close[0]!r}?" if close else ""
        super().__init__(
            f"There is no {role} called {name!r}.{hint} Known: {', '.join(known)}. "
            f"Others are added on the page, with `impactd materials {role} NAME KEY=VALUE...`, or "
            "in the materials file."
        )


@dataclass(frozen=True)
class Materials:
    """The spheres and surfaces that a drop may name."""

    spheres: dict[str, Sphere]
    surfaces: dict[str, Surface]
    reference_spheres: frozenset[str] = field(default=frozenset())
    """Those whose modulus counts as known: calibrations may use them."""
    reference_surfaces: frozenset[str] = field(default=frozenset())
    version: int = 0
    """Changes since the materials file, see `impactd.settings.material_book`."""

    def check(self, sphere: str, surface: str) -> None:
        """Raise `UnknownMaterialError` unless both are known."""
        if sphere not in self.spheres:
            raise UnknownMaterialError("sphere", sphere, tuple(self.spheres))
        if surface not in self.surfaces:
            raise UnknownMaterialError("surface", surface, tuple(self.surfaces))

    def why_no_reference(self, role: str, name: str) -> str | None:
        """Return why a ``sphere`` or ``surface`` cannot carry a calibration, ``None`` if it can.

        The reason is ready for a message.
        """
        known: Iterable[str] = self.spheres if role == "sphere" else self.surfaces
        references = self.reference_spheres if role == "sphere" else self.reference_surfaces
        if name not in known:
            return str(UnknownMaterialError(role, name, tuple(known)))
        if name not in references:
            return (
                f"{role} {name!r} is not marked reference = true in the materials file, so its "
                f"modulus does not count as known; references: {', '.join(sorted(references))}"
            )
        return None


class _Value(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)
    value: float = Field(allow_inf_nan=False)
    u: float = Field(ge=0, allow_inf_nan=False)

    def quantity(self) -> Quantity:
        return Quantity(self.value, self.u)


class _Measured(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)
    value: float = Field(gt=0, allow_inf_nan=False)
    u: float = Field(ge=0, allow_inf_nan=False)
    distribution: Literal["normal", "rectangular"] = "normal"
    degrees_of_freedom: float | None = Field(default=None, gt=0)
    traceable_to: str | None = None


class _Batch(BaseModel):
    """What the bag of balls says; it counts where radius or mass have no uncertainty themselves."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    grade: str
    mass_tolerance_kg: float | None = Field(default=None, ge=0, allow_inf_nan=False)
    traceable_to: str | None = None

    @field_validator("grade")
    @classmethod
    def _known(cls, grade: str) -> str:
        if grade not in grades():
            raise ValueError(f"there is no grade {grade!r}; known: {', '.join(grades())}")
        return grade


class _Modulus(_Value):
    value: float = Field(gt=0, allow_inf_nan=False)
    u: float = Field(gt=0, allow_inf_nan=False)


class _Coefficient(_Value):
    # as `storage.ranges` has it for campaigns
    value: float = Field(ge=MODULUS_COEFFICIENT_PER_K.low, le=MODULUS_COEFFICIENT_PER_K.high)


class _Poisson(_Value):
    # Thermodynamics allows -1; no material of such a rig is auxetic, and 0.5 is the limit.
    value: float = Field(gt=0, le=0.5)


_FORMS = ("a plain number", "a quantity")


_EITHER = Discriminator(lambda value: _FORMS[isinstance(value, dict | _Measured)])
_PLAIN = Tag(_FORMS[0])
_Quantity = Annotated[_Measured, Tag(_FORMS[1])]
_Temperature = Annotated[float, Field(ge=TEMPERATURE_C.low, le=TEMPERATURE_C.high)]
_Radius = Annotated[Annotated[float, Field(gt=0, le=0.1), _PLAIN] | _Quantity, _EITHER]
_Mass = Annotated[Annotated[float, Field(gt=0, le=1.0), _PLAIN] | _Quantity, _EITHER]
_CouponMass = Annotated[Annotated[float, Field(gt=0, le=10.0), _PLAIN] | _Quantity, _EITHER]
_Thickness = Annotated[Annotated[float, Field(gt=0, le=1.0), _PLAIN] | _Quantity, _EITHER]


class _SphereEntry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)
    radius_m: _Radius
    mass_kg: _Mass
    batch: _Batch | None = None
    youngs_modulus_pa: _Modulus | None = None
    poissons_ratio: _Poisson
    modulus_coefficient_per_k: _Coefficient | None = None
    modulus_temperature_c: _Temperature = STATED_AT_C
    reference: bool = False
    source: str


class _SurfaceEntry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)
    youngs_modulus_pa: _Modulus | None = None
    poissons_ratio: _Poisson
    modulus_coefficient_per_k: _Coefficient | None = None
    modulus_temperature_c: _Temperature = STATED_AT_C
    coupon_mass_kg: _CouponMass | None = None
    coupon_thickness_m: _Thickness | None = None
    reference: bool = False
    source: str


class _MaterialsFile(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)
    sphere: dict[str, _SphereEntry]
    surface: dict[str, _SurfaceEntry]


def load_materials(file: Path) -> Materials:
    """Return the spheres and surfaces of a materials file.

    It is TOML with tables ``sphere.NAME`` and ``surface.NAME``, SI units in the key names. Raises
    SettingsError if the file cannot be read, or a key is unknown, missing or wrong.
    """
    return materials_of(read_entries(file), file)


def read_entries(file: Path) -> dict[str, Any]:
    """Return the tables of a materials file, unchecked; raise SettingsError when it is no TOML."""
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(file, "", f"this is not valid TOML: {error}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(file, "", f"cannot be read: {error}") from None


def materials_of(content: Mapping[str, Any], file: Path | None) -> Materials:
    """Return the spheres and surfaces of tables as a materials file holds them.

    Raises SettingsError if a key is unknown, missing or wrong.
    """
    try:
        entries = _MaterialsFile.model_validate(content)
    except ValidationError as error:
        findings = tuple(
            # which of two forms was taken is no part of the path
            SettingsFinding(
                ".".join(str(part) for part in detail["loc"] if part not in _FORMS),
                f"{detail['msg']}",
            )
            for detail in error.errors()
        )
        raise SettingsError(file, findings[0].path_in_file, findings[0].reason, findings) from None
    _check_references(entries, file)
    return Materials(
        spheres={name: _sphere(name, entry) for name, entry in entries.sphere.items()},
        surfaces={name: _surface(name, entry) for name, entry in entries.surface.items()},
        reference_spheres=frozenset(n for n, e in entries.sphere.items() if e.reference),
        reference_surfaces=frozenset(n for n, e in entries.surface.items() if e.reference),
    )


def _check_references(entries: _MaterialsFile, file: Path | None) -> None:
    for table, members in (("sphere", entries.sphere), ("surface", entries.surface)):
        for name, entry in members.items():
            if entry.reference and entry.youngs_modulus_pa is None:
                raise SettingsError(
                    file,
                    f"{table}.{name}.reference",
                    "a material without youngs_modulus_pa cannot be a reference",
                )


def _split(number: float | _Measured | None) -> tuple[float | None, Uncertainty | None]:
    if not isinstance(number, _Measured):
        return number, None
    freedom = math.inf if number.degrees_of_freedom is None else number.degrees_of_freedom
    return number.value, Uncertainty(number.u, number.distribution, freedom, number.traceable_to)


def _plain(known: _Value | None) -> Quantity | None:
    return None if known is None else known.quantity()


def _of_batch(batch: _Batch, radius_m: float, mass_kg: float) -> tuple[Uncertainty, Uncertainty]:
    """Return what a batch says of radius and mass."""
    half_m = diameter_tolerance_m(batch.grade)
    # of one density, a ball's mass follows its diameter's cube
    half_kg = batch.mass_tolerance_kg
    if half_kg is None:
        half_kg = 3 * mass_kg * half_m / (2 * radius_m)
    told = batch.traceable_to or f"grade {batch.grade}"
    return (
        Uncertainty(rectangular_u(half_m / 2), "rectangular", traceable_to=told),
        Uncertainty(rectangular_u(half_kg), "rectangular", traceable_to=told),
    )


def _sphere(name: str, entry: _SphereEntry) -> Sphere:
    modulus = entry.youngs_modulus_pa
    radius_m, u_radius = _split(entry.radius_m)
    mass_kg, u_mass = _split(entry.mass_kg)
    if entry.batch is not None and radius_m is not None and mass_kg is not None:
        of_radius, of_mass = _of_batch(entry.batch, radius_m, mass_kg)
        u_radius, u_mass = u_radius or of_radius, u_mass or of_mass
    return Sphere(
        name=name,
        radius_m=radius_m,
        mass_kg=mass_kg,
        youngs_modulus_pa=modulus.quantity() if modulus else None,
        poissons_ratio=entry.poissons_ratio.quantity(),
        u_radius_m=u_radius,
        u_mass_kg=u_mass,
        modulus_coefficient_per_k=_plain(entry.modulus_coefficient_per_k),
        modulus_temperature_c=entry.modulus_temperature_c,
    )


def _surface(name: str, entry: _SurfaceEntry) -> Surface:
    modulus = entry.youngs_modulus_pa
    mass_kg, u_mass = _split(entry.coupon_mass_kg)
    thickness_m, u_thickness = _split(entry.coupon_thickness_m)
    return Surface(
        name=name,
        youngs_modulus_pa=modulus.quantity() if modulus else None,
        poissons_ratio=entry.poissons_ratio.quantity(),
        coupon_mass_kg=mass_kg,
        coupon_thickness_m=thickness_m,
        u_coupon_mass_kg=u_mass,
        u_coupon_thickness_m=u_thickness,
        modulus_coefficient_per_k=_plain(entry.modulus_coefficient_per_k),
        modulus_temperature_c=entry.modulus_temperature_c,
    )
