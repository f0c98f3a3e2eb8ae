"""Standard learners with default hyperparameters, beside classic controllers and a bound."""
