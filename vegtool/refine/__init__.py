"""Levels closer to the truth than the live original, by measured error."""
