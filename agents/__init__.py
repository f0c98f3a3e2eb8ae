"""Evaluation of controllers, classic and learned; training of policies is still to come."""
