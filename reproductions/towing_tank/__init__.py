"""The anti-spin paper on its own rig: a propeller of 0.25 m below a towing carriage."""
