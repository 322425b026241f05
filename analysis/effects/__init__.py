"""The effect library: one file per effect."""
