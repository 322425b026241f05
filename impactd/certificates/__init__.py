"""Digital calibration certificates (DCC): of a calibration out, of a load cell in."""
