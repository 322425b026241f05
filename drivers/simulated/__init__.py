"""A simulated rig that answers at the transport level, with its own physics."""
