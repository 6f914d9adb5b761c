"""What light does on surfaces: one model for geometry, billboards and surfels, whatever draws them.

Each GLSL chunk stands beside its numpy reference, which says the same in arrays:

    shading.glsl   shading.py   a sun, a sky, leaves that let light through
    shadow.glsl    shadow.py    what the sun sees of a plant

Nothing here draws: the chunks are put together by gl/program.py.
"""
