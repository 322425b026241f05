"""What ``impactd materials`` does."""

from __future__ import annotations

import json
import math
from typing import Any

import typer

from impactd.console.client import connect
from impactd.console.tables import print_json, table

Entry = dict[str, Any]


def list_all(*, url: str | None, as_json: bool) -> None:
    """Print every sphere and surface."""
    with connect(url) as client:
        found = client.get("/v1/materials")
    if as_json:
        print_json(found)
        return
    print(
        table(
            ("sphere", "radius/mm", "mass/g", "E +- u/GPa", "reference", "changed"),
            [
                (
                    one["name"],
                    _number(one["entry"].get("radius_m"), 1e3),
                    _number(one["entry"].get("mass_kg"), 1e3),
                    _number(one["entry"].get("youngs_modulus_pa"), 1e-9),
                    one["entry"].get("reference", False),
                    _changed(one),
                )
                for one in found["spheres"]
            ],
        )
    )
    print()
    print(
        table(
            ("surface", "coupon/g", "thick/mm", "E +- u/GPa", "reference", "changed"),
            [
                (
                    one["name"],
                    _number(one["entry"].get("coupon_mass_kg"), 1e3),
                    _number(one["entry"].get("coupon_thickness_m"), 1e3),
                    _number(one["entry"].get("youngs_modulus_pa"), 1e-9),
                    one["entry"].get("reference", False),
                    _changed(one),
                )
                for one in found["surfaces"]
            ],
        )
    )


def show_or_change(
    role: str,
    name: str,
    assignments: list[str],
    *,
    copy_of: str | None,
    note: str,
    url: str | None,
    as_json: bool,
) -> None:
    """Print one material and its changes, after changing it where something is assigned.

    Parameters
    ----------
    role : str
        ``sphere`` or ``surface``.
    assignments : list of str
        ``KEY=VALUE``.
    copy_of : str or None
        Begin with this one's entry.
    """
    at = f"/v1/materials/{role}s"
    with connect(url) as client:
        if assignments or copy_of is not None:
            entry = _entry(client.get("/v1/materials")[f"{role}s"], copy_of or name)
            if entry is None and copy_of is not None:
                raise typer.BadParameter(f"there is no {role} called {copy_of!r} to copy")
            body = {"entry": assigned(entry or {}, assignments), "note": note}
            client.send("PUT", f"{at}/{name}", body)
        shown = client.get(f"{at}/{name}")
        changes = client.get(f"{at}/{name}/changes")["items"]
    if as_json:
        print_json({**shown, "changes": changes})
        return
    for key, value in shown["entry"].items():
        print(f"{key:26} {_shown(value)}")
    for one in changes:
        why = f": {one['note']}" if one["note"] else ""
        print(f"Changed {one['utc'][:19].replace('T', ' ')} UTC by {one['by']}{why}")


def assigned(entry: Entry, assignments: list[str]) -> Entry:
    """Return an entry with what ``KEY=VALUE`` changes of it.

    Parameters
    ----------
    entry : dict
        In the keys of the materials file.
    assignments : list of str
        ``VALUE`` is a number, ``number+-u``, true, false or text; a dot leads into a table; empty
        takes the key away.

    Raises
    ------
    typer.BadParameter
        If one has no equals sign, leads into a number, or is `nan` or infinite.
    """
    found: Entry = json.loads(json.dumps(entry))
    for one in assignments:
        path, equals, text = one.partition("=")
        if not equals or not path:
            raise typer.BadParameter(f"{one!r} is no KEY=VALUE")
        *folders, key = path.split(".")
        place = found
        for folder in folders:
            place = place.setdefault(folder, {})
            if not isinstance(place, dict):
                raise typer.BadParameter(f"{one!r}: {folder} is one value, and holds no keys")
        if text == "":
            place.pop(key, None)
        else:
            place[key] = _value(text, one)
    return found


def _value(text: str, assignment: str) -> Any:
    if text in ("true", "false"):
        return text == "true"
    value, both, u = text.partition("+-")
    try:
        numbers = [float(value), float(u)] if both else [float(value)]
    except ValueError:
        return text
    if not all(math.isfinite(number) for number in numbers):
        raise typer.BadParameter(f"{assignment!r}: that is no number that a material can have")
    return {"value": numbers[0], "u": numbers[1]} if both else numbers[0]


def _entry(known: list[dict[str, Any]], name: str) -> Entry | None:
    return next((one["entry"] for one in known if one["name"] == name), None)


def _number(value: Any, scale: float) -> str:
    if value is None:
        return "-"
    if isinstance(value, dict):
        return f"{value['value'] * scale:.6g} +- {value['u'] * scale:.2g}"
    return f"{value * scale:.6g}"


def _shown(value: Any) -> str:
    if isinstance(value, dict) and "value" in value:
        more = [f"{key} {one}" for key, one in value.items() if key not in ("value", "u")]
        return ", ".join([f"{value['value']:.10g} +- {value['u']:.3g}", *more])
    if isinstance(value, dict):
        return ", ".join(f"{key} {one}" for key, one in value.items())
    return str(value)


def _changed(one: dict[str, Any]) -> str:
    return "" if one["changed_utc"] is None else f"{one['changed_utc'][:10]} {one['changed_by']}"
