"""The daemon: acquisition, storage, jobs, REST API and command line."""

__version__ = "0.1.0"
