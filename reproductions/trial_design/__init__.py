"""The planner's criteria and its search on published examples of experimental design."""
