"""Where plants stand, the ground that they stand on, and the tiles that they are merged into.

`terrain_of(scene)` reads the ground, `placement_of(scene, terrain)` the plants, from an inventory
or by rules; both are cut into square tiles, and the plants of a tile come most important first
(docs/placement.md). `species_of` finds what they look like, and `prepare` also makes what levels of
them are missing (docs/species.md); `pyramid_of` puts squares over the tiles, and `Run`
makes them (docs/commands/tiles.md).
"""
