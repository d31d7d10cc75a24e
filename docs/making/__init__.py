"""Sphinx extensions of the documentation site, and the modules that draw its pictures."""
