"""Fits outside the API process: the queue, the worker, its limits."""
