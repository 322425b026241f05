"""From a recording of any instrument to a campaign folder."""
