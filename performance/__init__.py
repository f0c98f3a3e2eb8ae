"""Speed trials and performance in service, by the standards of the trade.

:func:`analyse_trial` corrects a speed trial to calm deep water by ISO 15016, :func:`analyse_performance`
gives the speed loss of a ship in service by ISO 19030, and :func:`explain_periods` its physical cause.
:mod:`.corrections` has the formulas for wind,
waves, water and shallow water.
"""

from .corrections import Superstructure
from .monitoring import (
    PerformanceReport,
    ReferenceShip,
    analyse_performance,
    canonical_log,
    load_reference_ship,
    read_log,
)
from .physical_cause import PhysicalCause, explain_periods
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

__all__ = [
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
    "load_reference_ship",
    "load_trial_ship",
    "read_log",
    "read_runs",
]
