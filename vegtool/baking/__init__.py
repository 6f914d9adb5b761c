"""Billboards to textures: supersampled pictures of the clusters, packed into one atlas a level."""
