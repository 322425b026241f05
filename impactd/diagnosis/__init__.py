"""Diagnoses as people and programs get them: run, named models, the report."""
