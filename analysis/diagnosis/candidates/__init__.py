"""Named effects as hypotheses: from a first-order look to a fit that is priced."""
