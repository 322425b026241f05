"""The Omega OMB-DAQ-3500 (Personal Daq/3000 family) over USB. Untested on a 3500."""
