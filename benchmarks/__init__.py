"""Benchmarks: fps against character count, kernel cases with peers beside them."""
