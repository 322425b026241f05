"""The rig for Bluesky: a detector that is triggered by dropping a sphere, and a plan of drops."""
