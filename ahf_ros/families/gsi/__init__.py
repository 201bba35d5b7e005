"""Point-distributed targets: GSI's, and others that a data file describes."""
