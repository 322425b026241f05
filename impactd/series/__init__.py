"""Series of planned drops, run by the daemon itself."""
