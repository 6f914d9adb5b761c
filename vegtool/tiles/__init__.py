"""Where plants stand, and the ground that they stand on.

`terrain_of(scene)` reads the ground, `placement_of(scene, terrain)` the plants, from an inventory
or by rules; both are cut into square tiles, and the plants of a tile come most important first
(docs/placement.md). What plants look like is no business of this room.
"""
