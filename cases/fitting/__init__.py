"""Fits of a case: made before it is solved, and written beside what it then shows."""
