"""The judge of benchmarks/quality.py and benchmarks/gallery.py: what a stock client shows."""
