"""The recording's inputs through the ship, again and again, balance by balance."""
