"""How far a ball may be from its nominal diameter, by grade.

A ball of a grade is known to a rectangle: its half-width over sqrt(3) is the standard uncertainty
(JCGM 100, 4.3.7).

References
----------
.. [1] ISO 3290-1:2014 (grades G3 to G200), as tabled by makers, e.g. rgpballs.com and
   marteau-lemarie.com: largest preferred gauge, largest subgauge, variation of lot diameter.
.. [2] ANSI/ABMA 10 (grades 500 to 2000, which plastic balls are sold in), as tabled by
   itiball.com and ballbiz.com: tolerance of the nominal diameter and variation of lot diameter.
"""

from __future__ import annotations

import math

ISO_3290_UM = {
    3: (5.0, 0.2, 0.13),
    5: (5.0, 0.4, 0.25),
    10: (9.0, 0.4, 0.5),
    16: (10.0, 0.8, 0.8),
    20: (10.0, 0.8, 1.0),
    24: (12.0, 0.8, 1.2),
    28: (12.0, 0.8, 1.4),
    40: (16.0, 1.6, 2.0),
    60: (18.0, 2.4, 3.0),
    100: (40.0, 4.0, 5.0),
    200: (60.0, 6.0, 10.0),
}
"""Largest gauge, largest subgauge, variation of lot diameter [1]_. [um]"""
ABMA_UM = {500: (50.0, 25.0), 1000: (125.0, 50.0), 2000: (250.0, 100.0)}
"""Tolerance of the nominal diameter, variation of lot diameter [2]_. [um]"""


def grades() -> tuple[str, ...]:
    """Return the grades that are known, finest first."""
    return tuple(f"G{n}" for n in (*ISO_3290_UM, *ABMA_UM))


def diameter_tolerance_m(grade: str) -> float:
    """Return the largest distance of a ball's diameter from the nominal one, for one of `grades`.

    It is half the width of the rectangle. The lot's gauge counts as unknown: it may be any of the
    preferred ones. Raises KeyError if there is no such grade.
    """
    number = int(grade.removeprefix("G")) if grade in grades() else None
    if number in ISO_3290_UM:
        gauge, subgauge, variation = ISO_3290_UM[number]
        return (gauge + subgauge + variation / 2) * 1e-6
    if number in ABMA_UM:
        tolerance, variation = ABMA_UM[number]
        return (tolerance + variation / 2) * 1e-6
    raise KeyError(grade)


def rectangular_u(half_width: float) -> float:
    """Return the standard uncertainty of a value that lies anywhere within a half-width."""
    return half_width / math.sqrt(3)
