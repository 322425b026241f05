"""Columns: what a residual could look like if something in one slot were wrong."""
