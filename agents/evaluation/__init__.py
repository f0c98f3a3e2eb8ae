"""Any controller on any task, on paired seas."""
