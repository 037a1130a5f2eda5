"""Slow twins of `crowd_kernels.gait`."""


def key_at(phase, key_count):
    """Key before, key after and share between them at a phase in [0, 2)."""
    position = phase / 2 * key_count
    key = min(int(position), key_count - 1)
    return key, (key + 1) % key_count, position - key


def contact(contact_phase, weight, phase, foot):
    """Contact of one foot: weighted events of its examples (4, 2) against the time since its strike."""
    since = (phase - 0.5 * foot) % 1.0
    flat, lift = (weight[:, None] * contact_phase).sum(axis=0)
    return 1 if since < flat else 2 if since < lift else 0
