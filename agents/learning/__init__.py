"""Training of policies: recipes, checkpoints, and tuning of classic controllers and of recipes."""
