"""Compare what was measured with what a scenario expects."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from crowd.scenario.schema import Bound


@dataclass(frozen=True)
class Verdict:
    """One expectation.

    Attributes
    ----------
    key : str
        Metric.
    bound : Bound
    value : float or None
        What was measured; None when the run did not exercise it.
    """

    key: str
    bound: Bound
    value: float | None

    @property
    def is_met(self) -> bool:
        """The value was measured and lies inside the bounds."""
        if self.value is None:
            return False
        low, high = self.bound.min, self.bound.max
        return (low is None or self.value >= low) and (high is None or self.value <= high)

    @property
    def allowed(self) -> str:
        """The bounds in words."""
        low, high = self.bound.min, self.bound.max
        if low is not None and high is not None:
            return f"{low:g} to {high:g}"
        return f">= {low:g}" if low is not None else f"<= {high:g}"


def metric(measured: Mapping[str, Any], key: str) -> float | None:
    """Look up a metric by its key, such as ``"overlap.max_depth_m"``; None when it is absent."""
    value: Any = measured.get(key)
    if value is None:
        value = measured
        for part in key.split("."):
            value = value.get(part) if isinstance(value, Mapping) else None
    return float(value) if isinstance(value, int | float) else None


def judge(expected: Mapping[str, Bound], measured: Mapping[str, Any]) -> list[Verdict]:
    """Judge all expectations, in the order of the file."""
    return [Verdict(key, bound, metric(measured, key)) for key, bound in expected.items()]
