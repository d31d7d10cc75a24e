"""What stands behind `cli`: selections and motions in a few characters, a function a command."""
