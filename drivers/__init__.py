"""Bytes, buses, volts: the digitizer, the valve and a simulated rig that answers for both."""
