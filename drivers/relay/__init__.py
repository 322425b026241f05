"""Vacuum valves behind serial relay boards."""
