"""Closed loops in time: scenarios, hybrid systems, generated code and recorded trajectories."""
