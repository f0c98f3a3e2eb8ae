"""Rival methods for comparison: stepwise BIC and sparse identification."""
