"""Routes of the REST API, one resource per file."""
