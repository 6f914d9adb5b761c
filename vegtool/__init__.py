"""vegtool: levels of detail for plants, with their error measured.

Importing the package loads nothing but this line; every room is imported where it is used.
"""

__version__ = "0.1.0"
