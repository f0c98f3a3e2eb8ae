"""Training: recipes, legs and checkpoints, and how a policy in training sees its environments."""
