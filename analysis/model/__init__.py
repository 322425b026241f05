"""The base model: Hertz contact on a rigid cell (HSD) or a Kelvin-Voigt crystal (KV)."""
