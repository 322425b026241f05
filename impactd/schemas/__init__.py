"""JSON Schemas (2020-12) of what the program reads and writes; `impactd schema` prints them."""
