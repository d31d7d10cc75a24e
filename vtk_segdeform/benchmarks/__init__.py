"""Measurements: the paper's experiments, and its peers, each in one file; `report` runs them."""
