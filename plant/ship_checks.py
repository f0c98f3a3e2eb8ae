"""What must hold between the sections of a ship."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .expressions import FUNCTIONS
from .keys import require
from .manoeuvring import WITH as MANOEUVRING
from .manoeuvring import planar_inertia
from .record import PLANT
from .surroundings import WATER
from .terms import OF_A_TURN, TERM_SIGNALS, Term

if TYPE_CHECKING:
    from .ship import Ship


def check_terms(ship: Ship) -> None:
    """Refuse terms that hear or move what the ship does not have.

    Raises:
        ValueError: names the term and what is wrong with it.
    """
    ids = [term.id for term in ship.term]
    if twice := [name for name in ids if ids.count(name) > 1]:
        raise ValueError(f"term {twice[0]!r} stands twice")
    own = [name for name in TERM_SIGNALS if ship.turns or name not in OF_A_TURN]
    for name in ship.signals:
        if name in own or name in FUNCTIONS:
            raise ValueError(f"signals.{name}: a name of its own is needed")
    for term in ship.term:
        if unknown := [name for name in ship.heard_by(term) if name not in ship.signals]:
            known = [*own, *term.parameters, *ship.signals]
            raise ValueError(
                f"term {term.id!r}: {unknown[0]!r} is unknown; known: {', '.join(known)}; a "
                "signal from outside the ship is named, with its unit, under [signals]"
            )
        for where, lacking in _idle(ship, term):
            raise ValueError(f"term {term.id!r} acts on nothing: acts_on = {where!r} on {lacking}")


def _idle(ship: Ship, term: Term) -> list[tuple[str, str]]:
    """Where a term acts on nothing, and on what kind of ship."""
    places = [place for place, _ in term.expressions]
    held = "a shaft whose speed is held"
    straight = "a ship without a manoeuvring.length_m"
    found = [(p, held) for p in places if p in ("drive", "drive_torque") and not ship.turns_freely]
    turning = ("side_force", "yaw_moment")
    return found + [(p, straight) for p in places if p in turning and not ship.turns]


def check_fluid(ship: Ship) -> None:
    """Refuse effects of water or of its surface on a ship whose fluid has neither.

    Raises:
        ValueError: names the key, the density and what to do.
    """
    density = f"water.density_kg_m3 = {ship.water.density_kg_m3:g} kg/m3"
    if not ship.in_liquid and ship.moves:
        raise ValueError(
            f"{density} is a gas, in which no hull floats: water has about 1000 kg/m3. For a propeller "
            "in air say hull.fixed = true, and give the airspeed as inflow_velocity_m_s"
        )
    ventilation = ship.ventilation
    if not ship.in_liquid and any(
        (ventilation.thrust_loss, ventilation.torque_loss, ventilation.surface_loss)
    ):
        raise ValueError(
            f"ventilation draws air into a liquid, and {density} is a gas: leave [ventilation] out"
        )
    bucket = bool(ship.cavitation_bucket.model_fields_set)
    if not ship.in_water and (bucket or ship.propeller.cavitation_breakdown):
        key = "[cavitation_bucket]" if bucket else "propeller.cavitation_breakdown"
        raise ValueError(
            f"cavitation is modelled by the vapour pressure of water, and {density} is another fluid "
            f"(water: {WATER[0]:g} to {WATER[1]:g}): leave {key} out"
        )


def refuse_waves(ship: Ship, sea: Any) -> None:
    """Refuse a sea around a ship whose fluid has no surface.

    Args:
        ship: that is simulated.
        sea: SEA record, or None for calm water.

    Raises:
        ValueError: names the density.
    """
    if sea is not None and not ship.in_liquid:
        raise ValueError(
            f"{ship.name}: waves need a liquid, and water.density_kg_m3 = "
            f"{ship.water.density_kg_m3:g} kg/m3 is a gas: leave the sea out"
        )


def check_turning(ship: Ship) -> None:
    """Refuse a hull that cannot turn as its file says.

    Raises:
        ValueError: names the key.
    """
    if ship.rudder.area_m2 > 0.0 and not ship.turns:
        raise ValueError("rudder.area_m2 acts on nothing without a manoeuvring.length_m")
    if not ship.turns:
        return
    if not ship.moves:
        raise ValueError("manoeuvring.length_m asks for a hull that is not fixed")
    require(ship.water, ("density_kg_m3",), MANOEUVRING, "water.")
    if ship.hull.mass_kg < ship.manoeuvring.displacement_kg:
        raise ValueError(
            f"hull.mass_kg = {ship.hull.mass_kg:g} kg, with added mass, is less than "
            f"manoeuvring.displacement_kg = {ship.manoeuvring.displacement_kg:g} kg without"
        )
    plant = np.zeros(1, PLANT)[0]
    for section in (ship.water, ship.hull, ship.manoeuvring):
        section.fill(plant)
    sway, sway_yaw, yaw_sway, yaw = planar_inertia(plant)
    if not sway * yaw > sway_yaw * yaw_sway:
        raise ValueError(
            "manoeuvring: sway and yaw have no inertia of their own: Y_rdot and N_vdot (with "
            "centre_of_gravity_m) are too large beside Y_vdot and N_rdot"
        )
