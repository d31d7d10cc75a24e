"""What showing cages and dragging their vertices takes."""
