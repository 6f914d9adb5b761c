"""The parts of benchmarks/lighting.py: levels and plants under light, in vegtool's renderer."""
