"""Readers of surface files, one a format: from bytes to points and triangles."""
