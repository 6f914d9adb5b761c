"""Surfaces in connected pieces, and made of fewer triangles."""
