"""Hybrids: part mesh, part billboards, by what they cost."""
