"""The posterior of a fit: its density, draws from it, and how ArviZ reads them."""
