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
    location = tuple(part for part in detail["loc"])
    path = ".".join(str(part) for part in location)
    kind = detail["type"]
    if kind == "extra_forbidden":
        owner = _model_at(location[:-1], root)
        known = list(owner.model_fields) if owner else []
        close = difflib.get_close_matches(str(location[-1]), known, n=1, cutoff=0.6)
        hint = f"did you mean {close[0]}?" if close else f"known here: {', '.join(known)}"
        return SettingsFinding(path, f"unknown key; {hint}")
    if kind == "missing":
        return SettingsFinding(path, _explain_missing(location, root))
    if kind == "value_error":
        return SettingsFinding(path, str(detail["ctx"]["error"]))
    return SettingsFinding(path, f"{detail['msg']}, got {detail['input']!r}")


def _explain_missing(location: tuple[Any, ...], root: type[BaseModel]) -> str:
    owner = _model_at(location[:-1], root)
    field = owner.model_fields.get(str(location[-1])) if owner else None
    if field is None:
        return "missing"
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    meaning = f" ({field.description})" if field.description else ""
    source = f"; {extra['where']}" if "where" in extra else ""
    return f"missing{meaning}{source}; it has no default"


def _model_at(location: tuple[Any, ...], root: type[BaseModel]) -> type[BaseModel] | None:
    """Return the model that describes the table at a path."""
    model: type[BaseModel] | None = root
    for part in location:
        if isinstance(part, int):
            continue
        field = model.model_fields.get(str(part)) if model else None
        model = _model_in(field.annotation) if field else None
    return model


def _model_in(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in get_args(annotation):
        found = _model_in(argument)
        if found is not None:
            return found
    return None
