"""Light that varies in time: what detectors read after a pulse, and the moments of that."""
