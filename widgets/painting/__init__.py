"""What painting regions, fixed vertices and handles takes."""
