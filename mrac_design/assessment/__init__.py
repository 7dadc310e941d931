"""What may be said of a study's stability: hypotheses, gain advice, mismatch, worst cases."""
