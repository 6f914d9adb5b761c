"""OpenGL: contexts, programs, uploads, draws. The only room that imports moderngl.

Called by baking, measure and preview alone. Nothing here loads moderngl at import of the package.
"""
