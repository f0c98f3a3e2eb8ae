"""Validation on concealed effects: an independent simulator, sealed cases, and scores."""
