"""Figures of merit of recorded trajectories."""
