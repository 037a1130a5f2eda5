"""From a file's motion to clips of ours: names, axes, retargeting, labels, cycles, example sets."""
