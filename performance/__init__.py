"""Speed trials and performance in service, by the standards of the trade.

:func:`analyse_trial` corrects a speed trial to calm deep water by ISO 15016, :func:`analyse_performance`
gives the speed loss of a ship in service by ISO 19030. :mod:`.corrections` has the formulas for wind,
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
    "load_reference_ship",
    "load_trial_ship",
    "read_log",
    "read_runs",
]
