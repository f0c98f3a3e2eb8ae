"""Parameters and physics found together: every candidate model is refitted as a whole, in simulation."""
