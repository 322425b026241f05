"""Materials: spheres and coupons, changed or added without a restart, with who and when."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Literal

from fastapi import APIRouter, Path

from impactd.aliases import Json
from impactd.api.materials_schemas import MaterialBody
from impactd.api.problems import ProblemError
from impactd.api.security import TheCaller, TheDaemon
from impactd.settings.ball_grades import grades
from impactd.settings.errors import SettingsError
from impactd.settings.material_book import MaterialBook, MaterialChange, Role
from impactd.wire.material_answers import (
    MaterialAnswer,
    MaterialChangeAnswer,
    MaterialChangesAnswer,
    MaterialsAnswer,
)

router = APIRouter(prefix="/v1/materials", tags=["materials"])
_ROLES: dict[str, Role] = {"spheres": "sphere", "surfaces": "surface"}
_TOLD_CHANGES = 100
_Kind = Literal["spheres", "surfaces"]
_Name = Annotated[str, Path(min_length=1, max_length=64)]


@router.get("")
def list_materials(daemon: TheDaemon) -> MaterialsAnswer:
    """List spheres and surfaces as drops and fits take them now, and the latest changes."""
    book = daemon.book
    return MaterialsAnswer(
        version=book.version,
        spheres=[_answer(book, "sphere", *one) for one in book.entries("sphere").items()],
        surfaces=[_answer(book, "surface", *one) for one in book.entries("surface").items()],
        changes=[_change(one) for one in reversed(book.changes[-_TOLD_CHANGES:])],
        grades=list(grades()),
    )


@router.get("/{kind}/{name}")
def show_material(kind: _Kind, name: _Name, daemon: TheDaemon) -> MaterialAnswer:
    """Show one material, how often it was changed, and by whom last."""
    role = _ROLES[kind]
    return _answer(daemon.book, role, name, _entry(daemon.book, role, name))


@router.get("/{kind}/{name}/changes")
def list_changes(kind: _Kind, name: _Name, daemon: TheDaemon) -> MaterialChangesAnswer:
    """List every change of one material, newest first."""
    role = _ROLES[kind]
    _entry(daemon.book, role, name)
    return MaterialChangesAnswer(
        items=[_change(one) for one in reversed(_changes_of(daemon.book, role, name))]
    )


@router.put("/{kind}/{name}")
def change_material(
    kind: _Kind, name: _Name, body: MaterialBody, daemon: TheDaemon, caller: TheCaller
) -> MaterialAnswer:
    """Change a material or add one; it counts for drops and fits from now on.

    `entry` has the keys of the materials file and is complete, not a difference. Stored fits stay
    as they are; `impactd refit` makes them anew. The same entry again changes nothing.
    """
    role = _ROLES[kind]
    if daemon.book.entries(role).get(name) != body.entry:
        try:
            daemon.change_material(role, name, body.entry, by=caller.name, note=body.note)
        except SettingsError as error:
            raise _refused(error, role, name) from error
    return _answer(daemon.book, role, name, daemon.book.entries(role)[name])


def _refused(error: SettingsError, role: Role, name: str) -> ProblemError:
    prefix = f"{role}.{name}."
    findings = [(one.path_in_file.removeprefix(prefix), one.reason) for one in error.findings]
    said = "; ".join(f"{at}: {reason[:1].lower()}{reason[1:]}" for at, reason in findings)
    return ProblemError(
        "invalid",
        f"{said}.",
        remedy="Correct the named key; `GET /v1/materials` shows valid entries.",
        errors=[
            {"pointer": "#/entry/" + at.replace(".", "/"), "reason": reason}
            for at, reason in findings
        ],
    )


def _answer(book: MaterialBook, role: Role, name: str, entry: Json) -> MaterialAnswer:
    changes = _changes_of(book, role, name)
    last = changes[-1] if changes else None
    return MaterialAnswer(
        role=role,
        name=name,
        entry=entry,
        changed_utc=None if last is None else last.utc,
        changed_by=None if last is None else last.by,
        changes=len(changes),
    )


def _entry(book: MaterialBook, role: Role, name: str) -> Json:
    entries = book.entries(role)
    if name not in entries:
        raise ProblemError("not-found", f"There is no {role} called {name!r}.")
    return entries[name]


def _changes_of(book: MaterialBook, role: Role, name: str) -> list[MaterialChange]:
    return [one for one in book.changes if (one.role, one.name) == (role, name)]


def _change(change: MaterialChange) -> MaterialChangeAnswer:
    return MaterialChangeAnswer(**asdict(change))
