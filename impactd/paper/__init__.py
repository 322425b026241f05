"""`impactd paper`: every number of Maranzano & Hancock 2016 beside ours.

tables.toml (theirs) and analysis.paper (ours) -> claims; drivers.simulated and analysis -> rigs;
all of it -> page, pictures, JSON and a table on the terminal (run).
"""
