"""Joint fits: shared parameters, per-shot nuisances, outcome as a value."""
