"""Diagnose recordings and identify parameters: which physics a ship file lacks, and how large it is."""

from .condition import Monitoring
from .diagnosis import Diagnosis
from .estimate import Estimate
from .example import copy_example
from .folder import diagnose_folder
from .identify import Identification, identify
from .judge.held_out import fit_percent
from .judge.verdict import Finding
from .monitor import monitor
from .options import Options
from .pipeline import diagnose
from .planning.evidence import Noise
from .planning.manoeuvres import Limits
from .planning.plan import TrialPlan, plan_trial
from .recordings import Recording, fetch, load_recording
from .recordings.survey import Survey, survey
from .report.index import DiagnosisIndex
from .search.catalogue import Effect, Parameter, catalogue

__all__ = [
    "Diagnosis",
    "DiagnosisIndex",
    "Effect",
    "Estimate",
    "Finding",
    "Identification",
    "Limits",
    "Monitoring",
    "Noise",
    "Options",
    "Parameter",
    "Recording",
    "Survey",
    "TrialPlan",
    "catalogue",
    "copy_example",
    "diagnose",
    "diagnose_folder",
    "fetch",
    "fit_percent",
    "identify",
    "load_recording",
    "monitor",
    "plan_trial",
    "survey",
]
