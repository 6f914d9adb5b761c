"""Surfel-billboard hierarchies, and the triangles below them."""
