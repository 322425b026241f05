"""Diagnosis: test the residual, find the missing effect, state what is not known."""
