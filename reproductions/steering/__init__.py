"""Taylor's autopilot and cross-track controller (2000, chapter 5)."""
