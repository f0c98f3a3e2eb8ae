"""Learned policies on trial: against classic controllers, and with one observer against another."""
