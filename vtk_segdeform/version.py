"""The version of this release, read by setup.cfg, the documentation and the program itself."""

__version__ = "0.1.0"
