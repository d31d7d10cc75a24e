"""What dragging and turning handles takes."""
