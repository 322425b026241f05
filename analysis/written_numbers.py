"""A value with its uncertainty as people read it: terminal, reports and notebooks.

The page has the same rule in JavaScript; ``tests/page/test_one_number.py`` compares the two.
"""

from __future__ import annotations

import math
from typing import Any

K_95 = 1.959963984540054
"""Coverage factor of 95 % of a normal distribution (JCGM 100, G.3.4). It stands here because a
number must be printed without loading numpy."""
MOST_DECIMALS = 9
"""A choice: in SI units the ninth is a nanometre, a nanosecond or a microgram. Numbers that need
more have a power of ten."""


def measured(quantity: Any, *, scale: float = 1.0, sign: str = "+-") -> str:
    """Return a value with its expanded uncertainty U (95 %), to two digits of U.

    Parameters
    ----------
    quantity : dict or None
        ``value`` and ``u``, as JSON carries them; U is ``expanded`` where it is there, else 1.96 u.
    scale : float, optional
        Factor on both, for another unit. [1]
    sign : str, optional
        Between value and U; plain characters by default, as a pipe may hold no others.

    Returns
    -------
    str
        For example ``3.15 +- 0.24``; ``-`` for ``None``. Where shots have a value each, their
        median and range, and what they go with: ``0.31 (0.02 to 0.6 over 54 shots; falls from drop
        to drop, rank correlation -0.90)``. Where +- U would reach a sign that the quantity
        cannot have, its 95 % interval: ``89 (95 %: 12 .. 650)``.
    """
    if not isinstance(quantity, dict) or quantity.get("value") is None:
        return "-"
    value = quantity["value"] * scale
    if quantity.get("shots"):
        least, most = quantity["least"] * scale, quantity["most"] * scale
        over = "; ".join(
            [f"over {counted(quantity['shots'], 'shot')}", *(quantity.get("goes_with") or [])]
        )
        return f"{value:.3g} ({least:.3g} to {most:.3g} {over})"
    stated = (quantity.get("expanded") or {}).get("U")
    expanded = (K_95 * (quantity.get("u") or 0.0) if stated is None else stated) * scale
    if not (math.isfinite(expanded) and expanded > 0):
        return f"{value:.5g}"
    low, high = quantity.get("interval95") or (None, None)
    if low is not None and value - expanded < 0.0 <= low * scale:
        upper = "any" if high is None else f"{high * scale:.2g}"
        return f"{value:.2g} (95 %: {low * scale:.2g} .. {upper})"
    digits = decimals(expanded)
    if digits > MOST_DECIMALS or max(abs(value), expanded) >= 1e7:
        power = math.floor(math.log10(max(abs(value), expanded)))
        places = max(0, power + 1 - math.floor(math.log10(expanded)))
        both = (f"{one / 10**power:.{places}f}" for one in (value, expanded))
        return f"({f' {sign} '.join(both)})e{power:+03d}"
    return f"{value:.{digits}f} {sign} {expanded:.{digits}f}"


def counted(count: int, thing: str) -> str:
    """Return how many there are of a thing: ``1 shot``, ``2 shots``."""
    return f"{count} {thing}{'' if count == 1 else 's'}"


def decimals(expanded: float) -> int:
    """Return how many decimals a value has whose U shows two digits."""
    return max(0, 1 - math.floor(math.log10(expanded)))
