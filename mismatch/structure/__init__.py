"""Estimate parameters and effects together: each candidate model is refitted as a whole."""
