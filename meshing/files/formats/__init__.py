"""Readers of surface files, one per format: from bytes to points and triangles."""
