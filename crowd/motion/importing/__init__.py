"""From a file's motion to a clip of ours: names, units and axes, retargeting, labels, cycles, example sets."""
