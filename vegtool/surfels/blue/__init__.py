"""Progressive blue surfels: points of a surface in an order of which any prefix is a good picture.

Brandt, Jähn, Fischer, Meyer auf der Heide: Rendering of complex heterogenous scenes using
progressive blue surfels (2019).
"""
