"""Plants and scenes as they are walked through: eyes, controls, paths, frames and films."""
