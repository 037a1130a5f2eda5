"""Frame rate against number of characters, drawn as in the paper, with the paper's own figures in it."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from crowd.bench.report import PAPER_MILLISECONDS
from crowd.errors import SettingsError, describe

# The paper prints figure 7, of reaching and of locomotion, without numbers; frames per second follow from its
# table 2 as 1000 / (characters * milliseconds).
PAPER_CURVES = {
    "reaching": ("reach (blending)", "reach (inverse kinematics)"),
    "locomotion and steering": ("locomotion", "steering"),
    "everything": ("total",),
}
PAPER_CHARACTERS = 20
"""Number of characters up to which the paper states real-time performance."""


def require_matplotlib(option: str) -> None:
    """Refuse to draw where matplotlib is missing, before a long run begins.

    Parameters
    ----------
    option : str
        What asks for the picture, for the message.

    Raises
    ------
    SettingsError
        matplotlib is not installed.
    """
    if find_spec("matplotlib") is None:
        allowed = 'pip install "crowd-engine[bench]"'
        raise SettingsError(describe(option, "matplotlib is not installed", allowed=allowed))


def draw(rows: Sequence[Mapping[str, Any]], machine: Mapping[str, Any], path: Path) -> None:
    """Draw results to a picture file.

    Raises
    ------
    SettingsError
        matplotlib is not installed, or the file cannot be written.
    """
    require_matplotlib("--plot")
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7.5, 5.0), layout="constrained")
    for case in dict.fromkeys(row["case"] for row in rows):
        points = sorted((row["characters"], row["fps"]) for row in rows if row["case"] == case)
        axes.plot(*zip(*points, strict=True), marker="o", label=case.replace("_", " "))
    count = np.geomspace(1, 10_000, 50)
    for what, parts in PAPER_CURVES.items():
        milliseconds = sum(PAPER_MILLISECONDS[part] for part in parts)
        axes.plot(count, 1000.0 / (count * milliseconds), "--", lw=1, label=f"Feng et al., {what}")
    total = PAPER_MILLISECONDS["total"]
    axes.plot([PAPER_CHARACTERS], [1000.0 / (PAPER_CHARACTERS * total)], "kx", label='"over 20 characters"')
    axes.axhline(60.0, color="0.6", lw=0.8)
    axes.set(xscale="log", yscale="log", xlabel="characters", ylabel="frames per second", ylim=(5, None))
    threads = max(row["threads"] for row in rows)
    axes.set_title(f"{machine['processor']}, up to {threads} threads, {machine['date']}", fontsize=9)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    try:
        figure.savefig(path, dpi=110)
    except (OSError, ValueError) as error:
        raise SettingsError(describe(str(path), "cannot be drawn", str(error))) from error
    finally:
        plt.close(figure)
