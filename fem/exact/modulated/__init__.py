"""Closed forms of light that is modulated, or in time after a pulse."""
