"""Maranzano & Hancock 2016, computed: contacts, figures, single numbers, fits as theirs."""
