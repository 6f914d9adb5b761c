"""What the viewers of a scene can ever see of its plants, and so what of them is needed.

`viewers_of(scene, ground, placement)` says where eyes may be, `needs_of` what of each species they
see, `levels_needed` which of its levels that asks for, and `refined` which squares of a landscape
give way to their quarters (docs/methods/needs.md).
"""
