"""The findings about a settings file, as TOML paths and sentences."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel


@dataclass(frozen=True)
class SettingsFinding:
    """One thing that is wrong with a settings file."""

    path_in_file: str
    """Dotted TOML path, empty for the file as a whole."""
    reason: str
    """What is wrong and what to do."""

    def __str__(self) -> str:
        return f"{self.path_in_file}: {self.reason}" if self.path_in_file else self.reason


class SettingsError(Exception):
    """A settings file is missing or must not be used; it lists everything that is wrong.

    ``file`` is ``None`` when none was found. ``path_in_file`` and ``reason`` are those of the first
    of the ``findings``.
    """

    def __init__(
        self,
        file: Path | None,
        path_in_file: str,
        reason: str,
        findings: tuple[SettingsFinding, ...] = (),
    ) -> None:
        self.file = file
        self.path_in_file = path_in_file
        self.reason = reason
        self.findings = findings or (SettingsFinding(path_in_file, reason),)
        where = f"{file}: " if file is not None else ""
        super().__init__(where + "\n  ".join(str(finding) for finding in self.findings))


def explain(detail: Any, root: type[BaseModel]) -> SettingsFinding:
    """Return one of pydantic's ``ValidationError.errors()`` as a TOML path and a sentence.

    ``root`` is the model of the whole file.
    """
    parts, tables = _follow(detail["loc"], root)
    path = ".".join(parts)
    owner = tables[-1]
    kind = detail["type"]
    if kind == "extra_forbidden":
        known = list(owner.model_fields) if owner else []
        close = difflib.get_close_matches(parts[-1], known, n=1, cutoff=0.6)
        hint = f"did you mean {close[0]}?" if close else f"known here: {', '.join(known)}"
        return SettingsFinding(path, f"unknown key; {hint}")
    if kind == "missing":
        return SettingsFinding(path, _explain_missing(parts[-1], owner))
    if kind == "union_tag_invalid":
        wrong, known_kinds = detail["ctx"]["tag"], detail["ctx"]["expected_tags"]
        return SettingsFinding(f"{path}.driver", f"{wrong!r} is not known; known: {known_kinds}")
    if kind == "value_error":
        return SettingsFinding(path, str(detail["ctx"]["error"]))
    return SettingsFinding(path, f"{detail['msg']}, got {detail['input']!r}")


def _explain_missing(name: str, owner: type[BaseModel] | None) -> str:
    field = owner.model_fields.get(name) if owner else None
    if field is None:
        return "missing"
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    meaning = f" ({field.description})" if field.description else ""
    source = f"; {extra['where']}" if "where" in extra else ""
    return f"missing{meaning}{source}; it has no default"


def _follow(
    location: tuple[int | str, ...], root: type[BaseModel]
) -> tuple[list[str], list[type[BaseModel] | None]]:
    """Return the parts of a path in the file, and the model of the table each of them is in.

    Where a table may be of several kinds, pydantic names the kind in the path, the file does not.
    """
    parts: list[str] = []
    tables: list[type[BaseModel] | None] = []
    kinds = [root]
    for part in location:
        if len(kinds) > 1:
            kinds = [kind for kind in kinds if kind.model_fields["driver"].default == part]
            continue
        parts.append(str(part))
        tables.append(kinds[0] if kinds else None)
        if isinstance(part, str):
            field = kinds[0].model_fields.get(part) if kinds else None
            kinds = _models_in(field.annotation) if field else []
    return parts, tables or [root]


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for argument in get_args(annotation) for model in _models_in(argument)]
