"""The document of a diagnosis, `impactd-diagnosis/1`: its JSON, words and pictures."""
