"""The way that a scene names for its viewer: its file, and its course over the ground."""
