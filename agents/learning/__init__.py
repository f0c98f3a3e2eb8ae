"""Training of policies: recipes, checkpoints, tuning of classic controllers and of recipes."""
