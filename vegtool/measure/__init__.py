"""Measure: draws any level beside the truth and scores it. Views, pictures, contact sheets."""
