"""The policies of the package, compared with the best classic controllers."""
