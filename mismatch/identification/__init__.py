"""Estimation of ship parameters from recordings, with their uncertainty."""
