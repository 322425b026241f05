"""A value with its uncertainty as people read it: the rule of `analysis.written_numbers`."""

from analysis.written_numbers import K_95, decimals, measured

__all__ = ["K_95", "decimals", "measured"]
