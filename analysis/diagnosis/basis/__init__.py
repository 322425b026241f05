"""Basis columns: the residuals that a fault in one slot would cause."""
