"""Rival methods for comparison: regressions of equation errors, and models of the residual."""
