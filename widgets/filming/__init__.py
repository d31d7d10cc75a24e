"""What recordings and films are made of."""
