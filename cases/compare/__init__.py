"""Comparison of a run with closed forms, which `compare:` in a case file asks for."""
