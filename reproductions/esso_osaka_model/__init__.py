"""A free-running model of the tanker Esso Osaka in a pond."""
