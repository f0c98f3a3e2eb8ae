"""Speed trials and performance in service, by the standards of the trade.

:func:`analyse_trial` corrects a speed trial to calm deep water by ISO 15016, :func:`analyse_performance`
gives the speed loss of a ship in service by ISO 19030, and :func:`explain_periods` its physical cause.
:func:`find_runs` finds the runs of a trial in a log. :mod:`.corrections` has the formulas for wind,
waves, water and shallow water.
"""

from typing import TYPE_CHECKING, Any

from ..plant.wind import Superstructure
from .log_runs import LogRuns, find_runs
from .monitoring import (
    PerformanceReport,
    ReferenceShip,
    analyse_performance,
    canonical_log,
    load_reference_ship,
    read_log,
)
from .speed_trial import (
    SpeedTrial,
    TrialError,
    TrialShip,
    analyse_trial,
    canonical_runs,
    load_trial_ship,
    read_runs,
)
from .tables import TableError

if TYPE_CHECKING:
    from .physical_cause import PhysicalCause, explain_periods

__all__ = [
    "LogRuns",
    "PerformanceReport",
    "PhysicalCause",
    "ReferenceShip",
    "SpeedTrial",
    "Superstructure",
    "TableError",
    "TrialError",
    "TrialShip",
    "analyse_performance",
    "analyse_trial",
    "canonical_log",
    "canonical_runs",
    "explain_periods",
    "find_runs",
    "load_reference_ship",
    "load_trial_ship",
    "read_log",
    "read_runs",
]


def __getattr__(name: str) -> Any:
    """Import the physical cause at its first use, because the diagnosis takes a second to import."""
    if name not in ("PhysicalCause", "explain_periods"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from . import physical_cause

    return getattr(physical_cause, name)
