"""Arrays in, values out: contact models, fits, moduli with uncertainty."""
