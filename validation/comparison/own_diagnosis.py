"""The diagnosis of this package as a rival, and the ship file itself as the reference of gains."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...mismatch import Options, diagnose
from ...plant import load_ship
from .rival import RECORDING, ChallengeCase, Rival, entry_of


class OwnDiagnosis(Rival):
    """``shaftline diagnose`` with its defaults; the corrected ship predicts the held-out part."""

    name = "shaftline"
    quick = False

    def analyse(self, case: ChallengeCase) -> Mapping[str, Any]:
        """Return verdict, effects and predictions of the diagnosis."""
        calibrate = () if case.reference is None else (case.reference,)
        options = Options(calibrate=calibrate, quick=self.quick)
        found = diagnose(load_ship(case.ship), case.folder / RECORDING, options=options)
        return entry_of(found.to_dict()) | {"predictions": case.predict(found.corrected)}


class QuickDiagnosis(OwnDiagnosis):
    """``shaftline diagnose --quick``."""

    name = "shaftline-quick"
    quick = True


class ShipFile(Rival):
    """The ship file without changes: its gain is 0 by definition."""

    name = "ship-file"

    def analyse(self, case: ChallengeCase) -> Mapping[str, Any]:
        """Return the verdict that nothing is missing, and the simulation of the ship file."""
        held_out = case.simulated_held_out
        predictions = {name: held_out[name].tolist() for name in case.channels}
        return {"verdict": "nothing-missing", "predictions": predictions}
