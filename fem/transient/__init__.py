"""Light that varies in time: moments of what detectors read after a pulse."""
