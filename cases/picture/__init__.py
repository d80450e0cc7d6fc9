"""The picture of a run, by PyVista or without it."""
