"""Formulas where no name fits, on simulated ships whose missing physics is not in the catalogue."""
