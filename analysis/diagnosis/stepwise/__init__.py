"""Effects on top of one another, forward and backward."""
