"""A free-running model of the tanker Esso Osaka, real recordings: surge in turns, astern and in wind."""
