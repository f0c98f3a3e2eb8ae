"""Co-simulation by FMI 2.0: a ship or a policy as an FMU, and an FMU as a controller."""
