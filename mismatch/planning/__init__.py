"""Planning of trials that decide between models of a diagnosis, or narrow their intervals."""
