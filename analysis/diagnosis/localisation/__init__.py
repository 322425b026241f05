"""Which slot a discrepancy lives in."""
