"""Settings and materials: from TOML files to values that were checked."""
