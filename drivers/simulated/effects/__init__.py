"""The simulator's own effects, found by themselves.

``LIBRARY`` holds the effects a diagnosis may know, one file each; ``INVENTED`` (ids ``x_...``)
those it must not, a file for each part of the rig that they act on.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping

from drivers.simulated.effects.effect import Effect, Parameter, Scope, Shot

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")

EFFECTS: dict[str, type[Effect]] = {
    kind.id: kind for kind in sorted(Effect.__subclasses__(), key=lambda kind: kind.id)
}
LIBRARY = {name: kind for name, kind in EFFECTS.items() if not name.startswith("x_")}
INVENTED = {name: kind for name, kind in EFFECTS.items() if name.startswith("x_")}


def make_effect(
    effect_id: str, values: Mapping[str, float], scope: Scope | None = None, form: str = ""
) -> Effect:
    """Return an effect by its id.

    ``values`` has all parameters by name [SI]; ``scope`` left out means everywhere, ``form`` left
    out the first of the published forms. What is unknown or missing is a ValueError.
    """
    if effect_id not in EFFECTS:
        raise ValueError(f"No effect {effect_id!r}; the simulator knows {', '.join(EFFECTS)}.")
    return EFFECTS[effect_id](values, scope or Scope(), form)


__all__ = ["EFFECTS", "INVENTED", "LIBRARY", "Effect", "Parameter", "Scope", "Shot", "make_effect"]
