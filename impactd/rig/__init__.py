"""The devices of a rig, real or simulated, put together from its settings."""
