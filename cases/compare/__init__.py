"""Comparison of a run with closed forms, as the key ``compare`` of a case file asks for it."""
