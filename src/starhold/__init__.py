"""starhold designs, certifies, flies and compares attitude-control laws of spacecraft."""
__version__ = "0.1.0"
