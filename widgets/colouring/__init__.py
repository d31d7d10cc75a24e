"""What showing a number per vertex takes."""
