"""Tables of what detectors have read."""
