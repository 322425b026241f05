"""What the command line prints and whom it asks."""
