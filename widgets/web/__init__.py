"""The editor in a web page."""
