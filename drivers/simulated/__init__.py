"""A simulated rig that answers at the transport level, with physics of its own."""
