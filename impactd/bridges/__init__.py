"""Bridges from the daemon's events to MQTT, webhooks, OPC UA and a Tiled catalogue.

Each bridge is a process of its own and a client of the REST API like any other: whatever happens
to a broker or to a bridge, nothing of it reaches the rig.
"""
