"""Parameter spaces: which examples to blend, with which weights."""
