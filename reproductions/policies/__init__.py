"""The policies of the package: the recipe of each task, trained, beside the best classic law."""
