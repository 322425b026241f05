"""Discrepancies for a residual without a name: flexible columns and waveforms."""
