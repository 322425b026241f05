"""Shot files, the index over them, and campaign folders."""
