"""Evaluation of controllers on tasks, with the same seas for every controller."""
