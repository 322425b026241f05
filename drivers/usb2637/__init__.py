"""The MCC USB-2637 over USB: 16 bits, 1 MS/s. Untested on a board."""
