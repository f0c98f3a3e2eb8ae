"""Replay recordings through the ship model and compute the residuals of its balances."""
