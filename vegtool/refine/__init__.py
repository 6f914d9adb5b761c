"""Levels closer to the truth than the live original: coverage, colour and planes by measured error."""
