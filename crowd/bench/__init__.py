"""Benchmarks: frames per second against the number of characters, quality sweeps, kernels beside peers."""
