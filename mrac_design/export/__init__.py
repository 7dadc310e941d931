"""Results and tuned gains as files for other programs."""
