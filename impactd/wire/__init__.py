"""What goes over the wire, for both ends: the daemon's API and its clients."""
