"""What a diagnosis says: `impactd-diagnosis/1`, its words and pictures."""
