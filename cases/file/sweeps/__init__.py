"""Sweeps: from values by dotted key to runs with data and names of their own."""
