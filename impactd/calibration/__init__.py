"""Calibrating the load cell: by drops of known spheres, or by weights."""
