"""Surfaces and tetrahedra on disk."""
