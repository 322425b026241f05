"""Closing the loop: find the residual, trace it, add the effect, say what is not known."""
