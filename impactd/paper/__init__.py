"""`impactd paper`: every number of Maranzano & Hancock 2016 beside ours.

tables.toml (theirs) and analysis.paper (ours) -> claims; drivers.simulated and analysis -> rigs
(Tables 3-5, printed_rows) and pair_traces (Figs 5 and 6, the closed model); all of it -> page,
pictures, JSON and tables on the terminal (run).
"""
