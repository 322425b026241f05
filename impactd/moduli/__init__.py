"""Moduli of all materials from all shots, and what their uncertainties are made of."""
